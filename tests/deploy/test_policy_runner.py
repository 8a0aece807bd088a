"""A policy at its own rate: its inputs and their times, late steps and failures."""

import math
import sys
from itertools import cycle
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import FailingPolicy, Hold, stand_still
from fake_time import Watch

from footfall import JointCommand, Robot, UserError
from footfall.deploy import policy_runner
from footfall.deploy.battery import NO_BATTERY
from footfall.deploy.command_source import VelocityFunction, source_of
from footfall.deploy.handover import Handover
from footfall.deploy.policy_runner import PolicyRunner
from footfall.deploy.steering import Steering
from footfall.policies.policy import Sensed

READINGS = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), *np.zeros((3, 12)))
ESTIMATE = (np.array([0.1, 0.2, 0.3]), 0.3)
TICK_US = 2000


def runner_of(policy: Any, source: VelocityFunction = stand_still, realtime: bool = False) -> PolicyRunner:
    """A runner at 500 Hz that may take 0.1 s for a step."""
    return PolicyRunner(Handover([policy]), Steering(source_of(source), [policy]), 500.0, 0.1, realtime)


def step(runner: PolicyRunner, now_us: int, walking: bool = True) -> Any:
    run: Any = SimpleNamespace(walking_s=runner.time_s(now_us), battery=NO_BATTERY)
    return runner.step(now_us, run, READINGS, ESTIMATE, walking)


def walk(runner: PolicyRunner, times_us: Any, walking: bool = True) -> list[float]:
    """Times of a policy's steps since its start, s."""
    runner.start(times_us[0])
    taken = (
        now_us for now_us in times_us if runner.due(now_us) and step(runner, now_us, walking) is not None
    )
    return [*map(runner.time_s, taken)]


class TestTimes:
    def test_steps_come_at_the_first_tick_of_their_time(self, go1: Robot) -> None:
        """A rate is at most the joints' rate."""
        for rate_hz in (30.0, 50.0, 77.0, 500.0):
            policy = Hold(go1)
            policy.rate_hz = rate_hz
            times = walk(runner_of(policy), range(100_000, 702_000, TICK_US))
            due = np.arange(len(times)) / rate_hz
            np.testing.assert_allclose(times, np.ceil(np.round(due / 0.002, 6)) * 0.002, atol=1e-9)
            assert (len(times), policy.resets) == (math.floor(0.6 * rate_hz + 1e-6) + 1, 1)
        for policy.rate_hz in (500.1, 0.0, -1.0, math.nan):
            with pytest.raises(UserError):
                runner_of(policy)

    def test_missed_steps_are_not_made_up_for(self, go1: Robot) -> None:
        """After a pause of 76 ms there is one step, and the next at the following multiple of 20 ms."""
        times = walk(runner_of(Hold(go1)), [*range(0, 52_000, TICK_US), *range(126_000, 186_000, TICK_US)])
        assert times == pytest.approx([0, 0.02, 0.04, 0.126, 0.14, 0.16, 0.18])


def test_late_steps_count_in_a_row(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """At 50 Hz a step of 21 ms is late."""
    watch = Watch()
    monkeypatch.setattr(policy_runner, "time", SimpleNamespace(perf_counter=watch))

    def slow(command: JointCommand) -> JointCommand:
        watch.now_s += next(durations_s)
        return command

    for pattern, longest in (("L.", 1), ("LLLL.", 4), ("LLLLL", 15)):
        durations_s = cycle(0.021 if letter == "L" else 0.019 for letter in pattern)
        runner, counts = runner_of(FailingPolicy(go1, 0.0, slow), realtime=True), []
        runner.start(0)
        for now_us in range(0, 300_000, 20_000):
            step(runner, now_us)
            counts.append(runner.signals.late_steps)
        assert max(counts) == longest


def test_a_policy_gets_the_command_of_its_time_and_zero_while_stopping(go1: Robot) -> None:
    policy = Hold(go1)
    walk(runner_of(policy, lambda t: np.array([t, 2 * t, 0.0])), range(50_000, 120_000, TICK_US))
    commands = np.array([seen.command for seen in policy.seen])
    np.testing.assert_allclose(commands[:, :2], np.outer([0.0, 0.02, 0.04, 0.06], [1, 2]), atol=1e-9)
    assert (policy.seen[0].base_velocity, policy.seen[0].base_height) == ESTIMATE
    walk(runner_of(policy, lambda _: np.ones(3)), [0], walking=False)
    assert policy.seen[-1].command.tolist() == [0.0, 0.0, 0.0]


class TestFailure:
    def test_a_step_that_returns_no_valid_command_is_a_failure(self, go1: Robot) -> None:
        changes: list[tuple[Any, str]] = [
            (lambda hold: [part[:11] for part in hold], "WrongSizeError: .* (5, 11)"),
            (lambda hold: hold[:4], "WrongSizeError: .* (4, 12)"),
            (lambda hold: [part + 0j for part in hold], "ValueError"),
            (lambda hold: [np.ma.masked_less(part, 0.5) for part in hold], "ValueError"),
            (lambda hold: {}["legs"], "KeyError: 'legs'"),
            (lambda hold: sys.exit(3), "SystemExit: 3"),
        ]
        for change, error in changes:
            runner = runner_of(FailingPolicy(go1, 0.0, change))
            assert (walk(runner, [0]), runner.decision) == ([], None)
            assert all(part in runner.signals.error for part in error.split(".*"))

    @pytest.mark.parametrize("part", JointCommand._fields)
    def test_a_command_that_is_not_finite_is_signalled(self, go1: Robot, part: str) -> None:
        added = iter((math.nan, 0.0))
        change = lambda command: command._replace(**{part: getattr(command, part) + next(added)})  # noqa: E731
        runner = runner_of(FailingPolicy(go1, 0.0, change))
        runner.start(0)
        for now_us, finite in ((0, False), (20_000, True)):
            step(runner, now_us)
            assert runner.signals.command_finite is finite
