"""A policy at its own rate: its inputs and their times, late steps and failures."""

import math
import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold, stand_still

from footfall import JointCommand, Robot, UserError
from footfall.deploy import policy_runner
from footfall.deploy.battery import NO_BATTERY
from footfall.deploy.command_source import VelocityFunction, source_of
from footfall.deploy.handover import Handover
from footfall.deploy.policy_runner import PolicyRunner
from footfall.deploy.steering import Steering
from footfall.policies.policy import PolicyInput, Sensed

READINGS = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), *np.zeros((3, 12)))
ESTIMATE = (np.array([0.1, 0.2, 0.3]), 0.3)
TICK_US = 2000


def runner_of(policy: Any, source: VelocityFunction = stand_still, realtime: bool = False) -> PolicyRunner:
    """A runner at 500 Hz that may take 0.1 s for a step."""
    return PolicyRunner(Handover([policy]), Steering(source_of(source), [policy]), 500.0, 0.1, realtime)


def run_at(runner: PolicyRunner, now_us: int) -> Any:
    return SimpleNamespace(walking_s=runner.time_s(now_us), battery=NO_BATTERY)


def step(runner: PolicyRunner, now_us: int, walking: bool = True) -> Any:
    return runner.step(now_us, run_at(runner, now_us), READINGS, ESTIMATE, walking)


def walk(runner: PolicyRunner, times_us: Any, walking: bool = True) -> list[float]:
    """Times of a policy's steps since its start, s."""
    times = list(times_us)
    runner.start(times[0])
    taken = []
    for now_us in times:
        if runner.due(now_us) and step(runner, now_us, walking) is not None:
            taken.append(runner.time_s(now_us))
    return taken


class Stopwatch:
    """Replaces `time`: it advances only on request."""

    now_s = 0.0

    def perf_counter(self) -> float:
        return self.now_s


@pytest.fixture
def watch(monkeypatch: pytest.MonkeyPatch) -> Stopwatch:
    watch = Stopwatch()
    monkeypatch.setattr(policy_runner, "time", watch)
    return watch


class SlowSteps(Hold):
    """A policy whose steps take the given durations in turn, s."""

    def __init__(self, robot: Robot, watch: Stopwatch, *durations_s: float) -> None:
        super().__init__(robot)
        self._watch, self._durations_s = watch, durations_s

    def act(self, inputs: PolicyInput) -> JointCommand:
        self._watch.now_s += self._durations_s[len(self.seen) % len(self._durations_s)]
        return super().act(inputs)


class Changing(Hold):
    """Holds the default pose, with a change to its command."""

    def __init__(self, robot: Robot, change: Any) -> None:
        super().__init__(robot)
        self._change = change

    def act(self, inputs: PolicyInput) -> JointCommand:
        return self._change(super().act(inputs))  # type: ignore[no-any-return]


class TestTimes:
    @pytest.mark.parametrize("rate_hz", [30.0, 50.0, 77.0, 500.0])
    def test_steps_come_at_the_first_tick_of_their_time(self, go1: Robot, rate_hz: float) -> None:
        policy = Hold(go1)
        policy.rate_hz = rate_hz
        times = walk(runner_of(policy), range(100_000, 702_000, TICK_US))
        due = np.arange(len(times)) / rate_hz
        np.testing.assert_allclose(times, np.ceil(np.round(due / 0.002, 6)) * 0.002, atol=1e-9)
        assert len(times) == math.floor(0.6 * rate_hz + 1e-6) + 1
        assert policy.resets == 1

    def test_missed_steps_are_not_made_up_for(self, go1: Robot) -> None:
        """After a pause of 76 ms there is one step, and the next at the following multiple of 20 ms."""
        times = walk(runner_of(Hold(go1)), [*range(0, 52_000, TICK_US), *range(126_000, 186_000, TICK_US)])
        assert times == pytest.approx([0, 0.02, 0.04, 0.126, 0.14, 0.16, 0.18])

    @pytest.mark.parametrize(
        ("rate_hz", "fits"), [(500.0, True), (500.1, False), (0.0, False), (-1.0, False), (math.nan, False)]
    )
    def test_a_policys_rate_is_at_most_the_joints_rate(self, go1: Robot, rate_hz: float, fits: bool) -> None:
        policy = Hold(go1)
        policy.rate_hz = rate_hz
        if fits:
            runner_of(policy)
        else:
            with pytest.raises(UserError):
                runner_of(policy)


@pytest.mark.parametrize(
    ("pattern", "longest"), [("L.", 1), ("LLLL.", 4), ("LLLLL", 15)], ids=["one", "four", "all"]
)
def test_late_steps_count_in_a_row(go1: Robot, watch: Stopwatch, pattern: str, longest: int) -> None:
    """At 50 Hz a step of 21 ms is late."""
    runner = runner_of(SlowSteps(go1, watch, *(0.021 if c == "L" else 0.019 for c in pattern)), realtime=True)
    counts = []
    runner.start(0)
    for now_us in range(0, 300_000, 20_000):
        step(runner, now_us)
        counts.append(runner.signals.late_steps)
    assert max(counts) == longest


def test_a_policy_gets_the_command_of_its_time_and_zero_while_stopping(go1: Robot) -> None:
    policy = Hold(go1)
    walk(runner_of(policy, lambda t: np.array([t, 2 * t, 0.0])), range(50_000, 120_000, TICK_US))
    commands = np.array([seen.command for seen in policy.seen])
    np.testing.assert_allclose(commands[:, 0], [0.0, 0.02, 0.04, 0.06], atol=1e-9)
    np.testing.assert_allclose(commands[:, 1], 2 * commands[:, 0])
    assert (policy.seen[0].base_velocity, policy.seen[0].base_height) == ESTIMATE
    policy = Hold(go1)
    walk(runner_of(policy, lambda _: np.ones(3)), [0], walking=False)
    assert policy.seen[0].command.tolist() == [0.0, 0.0, 0.0]


class TestFailure:
    @pytest.mark.parametrize(
        ("change", "error"),
        [
            (lambda hold: [part[:11] for part in hold], "WrongSizeError: .* (5, 11)"),
            (lambda hold: hold[:4], "WrongSizeError: .* (4, 12)"),
            (lambda hold: [part + 0j for part in hold], "ValueError"),
            (lambda hold: [np.ma.masked_less(part, 0.5) for part in hold], "ValueError"),
            (lambda hold: {}["legs"], "KeyError: 'legs'"),
            (lambda hold: sys.exit(3), "SystemExit: 3"),
        ],
    )
    def test_a_step_that_returns_no_valid_command_is_a_failure(
        self, go1: Robot, change: Any, error: str
    ) -> None:
        runner = runner_of(Changing(go1, change))
        assert walk(runner, [0]) == []
        assert all(part in runner.signals.error for part in error.split(".*"))
        assert runner.decision is None

    @pytest.mark.parametrize("part", JointCommand._fields)
    def test_a_command_that_is_not_finite_is_signalled(self, go1: Robot, part: str) -> None:
        class ChangesRate(Hold):
            def act(self, inputs: PolicyInput) -> JointCommand:
                hold = super().act(inputs)
                odd = getattr(hold, part) + (math.nan if len(self.seen) == 1 else 0.0)
                return hold._replace(**{part: odd})

        runner, finite = runner_of(ChangesRate(go1)), []
        runner.start(0)
        for now_us in (0, 20_000):
            step(runner, now_us)
            finite.append(runner.signals.command_finite)
        assert finite == [False, True]
