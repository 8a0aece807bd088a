"""Policies that hand the robot over to each other while it walks."""

from itertools import groupby
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
from deploy_policies import Hold

from footfall import Episode, Robot, UserError, load_policy, run_episode
from footfall.deploy.changes import Change
from footfall.deploy.command_source import Request
from footfall.deploy.config import DeployConfig
from footfall.deploy.field_mode import FieldMode
from footfall.deploy.handover import Handover, HandoverConfig, blended
from footfall.deploy.replay import replay
from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.actuator import JointCommand, pd_torque

QUICK = HandoverConfig(still_s=0.1, wait_s=0.2, blend_s=0.1)
REST = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), *np.zeros((3, 12)))


class BentPose(Hold):
    """Holds another pose, at its own rate."""

    def __init__(self, robot: Robot, name: str, by_rad: float = 0.0, rate_hz: float = 50.0) -> None:
        super().__init__(robot)
        self.name, self.rate_hz, self._by_rad = name, rate_hz, by_rad
        self.plan = np.ones(4)

    def act(self, inputs: PolicyInput) -> JointCommand:
        command = super().act(inputs)
        return command._replace(position=command.position + self._by_rad)

    def stance(self) -> np.ndarray:  # type: ignore[override]
        return self.plan


def walk(policies: Handover, until_s: float, from_s: float = 0.0) -> list[tuple[str, np.ndarray]]:
    """Steps at 500 Hz as in the loop: current policy, position targets."""
    steps = []
    for now_us in range(round(from_s * 1e6), round(until_s * 1e6), 2000):
        if policies.due(now_us):
            command = np.array([0.0 if policies.leaving else 0.3, 0.0, 0.0])
            decision = policies.step(now_us, PolicyInput(now_us * 1e-6, REST, command, np.zeros(3), 0.3))
            steps.append((policies.current.policy.name, decision[0]))
    return steps


class TestHandover:
    def test_a_handover_stops_blends_and_then_uses_the_next_policy(self, go1: Robot) -> None:
        first, second = BentPose(go1, "a", rate_hz=50.0), BentPose(go1, "b", 0.2, rate_hz=250.0)
        policies = Handover([first, second], QUICK)
        walk(policies, 1.0)
        assert len(second.seen) == 0
        policies.apply(Change(policy="b"), 1_000_000)
        steps = walk(policies, 2.0, 1.0)
        target = np.array([position[0] for _, position in steps]) - steps[0][1][0]
        assert np.abs(np.diff(target)).max() < 0.02  # of the blend's 0.2 rad, and no joint target jumps
        assert (steps[0][0], steps[-1][0], target[-1]) == ("a", "b", pytest.approx(0.2))
        assert (second.seen[0].time_s, second.seen[0].command.tolist()) == (0.0, [0.0, 0.0, 0.0])
        assert second.seen[-1].command.tolist() == [0.3, 0.0, 0.0]
        assert np.diff([inputs.time_s for inputs in second.seen]) == pytest.approx(0.004)

    def test_a_handover_waits_for_raised_feet_up_to_its_limit(self, go1: Robot) -> None:
        first, second = BentPose(go1, "a"), BentPose(go1, "b")
        policies = Handover([first, second], QUICK)
        walk(policies, 0.5)
        first.plan = np.array([1.0, 0.0, 0.0, 1.0])
        policies.apply(Change(policy="b"), 500_000)
        walk(policies, 0.78, 0.5)
        assert len(second.seen) == 0
        walk(policies, 0.9, 0.78)
        assert len(second.seen) > 0

    def test_two_policies_of_one_name_are_refused(self, go1: Robot) -> None:
        with pytest.raises(UserError, match="a, a"):
            Handover([BentPose(go1, "a"), BentPose(go1, "a")])


def test_a_blend_has_the_torque_of_both_at_any_position_and_velocity() -> None:
    rng = np.random.default_rng(3)
    first, second = rng.uniform(0.0, 2.0, (2, 5, 12))
    first[2, :6] = second[3, 3:9] = 0.0
    position, velocity = rng.normal(size=(2, 12))
    torque = [pd_torque(JointCommand.of(each), position, velocity) for each in (first, second)]
    mean = pd_torque(JointCommand.of(blended(first, second, 0.3)), position, velocity)
    np.testing.assert_allclose(mean, 0.7 * torque[0] + 0.3 * torque[1])


def test_a_run_with_switches_replays_to_the_bit(go1: Robot, tmp_path: Path) -> None:
    def policies() -> list:
        return [load_policy(name, go1) for name in ("trot", "go1-flat", "stand")]

    ahead = np.array([0.2, 0.0, 0.1])
    requests = (
        (0.0, Request(ahead)),
        (0.1, Request(ahead, policy="mpc", gait="waltz")),  # the run has neither
        (0.2, Request(ahead, gait="walk", settings={"step_height_m": 0.03, "step_period_s": 0.55})),
        (0.3, Request(ahead, policy="go1-flat")),
        (0.8, Request(ahead, policy="trot")),
    )
    source = Mock(spec=["poll", "stopped"], stopped=None)
    source.poll.side_effect = lambda status: [each for at_s, each in requests if status.walking_s >= at_s][-1]
    first, *others = policies()
    log = tmp_path / "run.mcap"
    config = DeployConfig(stand_s=0.4, handover=HandoverConfig(0.2, 1.0, 0.1))
    by_name = {policy.name: policy for policy in others}
    episode = Episode(source, 1.7, config=config, log=log, others=by_name, record=False)
    trace = run_episode(go1, first, episode)
    assert not trace.fell
    statuses = [call.args[0] for call in source.poll.mock_calls]
    assert [name for name, _ in groupby(status.policy for status in statuses)] == ["trot", "go1-flat", "trot"]
    assert sum("mpc" in note or "waltz" in note for note in trace.notes) == 2
    modes = {FieldMode.CALIBRATING, FieldMode.TELEOPERATION, FieldMode.ENDING}
    assert {status.field_mode for status in statuses} >= modes
    first, *others = policies()
    result = replay(log, first, others=others)
    assert (result.first_difference, result.worst_difference) == ("", 0.0)
    assert replay(log, first, others=others[::-1]).first_difference == ""
    assert replay(log, others[0], others=[first, others[1]]).first_difference
