"""Steps and posture of hand-written controllers, changed while they walk."""

import numpy as np
import pytest

from footfall.deploy.command_source import Request, Status, Stop
from footfall.plant.episode import Episode, run_episode
from footfall.policies.live_settings import DECLARED, Applied, Steerable
from footfall.policies.policy import PolicyInput
from footfall.policies.registry import load_policy
from footfall.robots.actuator import JointCommand
from footfall.robots.description import load_robot

AT_S = 0.9


class Changes:
    """Walks, and requests other steps at a given time."""

    stopped: Stop | None = None

    def __init__(self, gait: str) -> None:
        self._gait = gait

    def poll(self, status: Status) -> Request:
        request = Request(np.array([0.2, 0.0, 0.0]))
        if status.walking_s < AT_S:
            return request
        values = {name: span.lowest for name, span in status.offer.settings.items()} | {"pitch_rad": 0.1}
        return request._replace(settings=values | {"step_period_s": 9.0}, gait=self._gait)


@pytest.mark.parametrize(("robot_name", "name", "gait"), [("go1", "trot", "walk"), ("go1", "mpc", "walk")])
def test_changes_act_and_no_joint_target_jumps(robot_name: str, name: str, gait: str) -> None:
    robot = load_robot(robot_name)
    policy = load_policy(name, robot)
    assert isinstance(policy, Steerable)
    assert set(policy.live_settings) <= set(DECLARED)
    seen: list[PolicyInput] = []
    targets: list[np.ndarray] = []
    shown: list[Applied] = []
    act = policy.act

    def watched(inputs: PolicyInput) -> JointCommand:
        seen.append(inputs)
        decision = act(inputs)
        targets.append(decision.position.copy())
        shown.append(policy.applied)
        return decision

    policy.act = watched  # type: ignore[method-assign]
    trace = run_episode(robot, policy, Episode(Changes(gait), 2.6))
    assert not trace.fell
    applied = [each for each in shown if each.gait == gait]
    assert shown[0].gait == "trot"
    assert applied  # once it acts
    assert set(shown[-1].settings) == set(policy.live_settings)
    for setting, goal in {
        "pitch_rad": 0.1,
        "body_height_m": policy.live_settings["body_height_m"].lowest,
    }.items():
        assert shown[-1].settings[setting] == pytest.approx(goal, abs=0.01), setting
    assert shown[-1].settings["step_period_s"] > shown[0].settings["step_period_s"] + 0.05  # on its way
    heights = [each.settings["body_height_m"] for each in shown]
    assert np.abs(np.diff(heights)).max() < 0.005  # approached, which is what an operator sees
    assert any("step_period_s" in note for note in trace.notes)  # clipped
    rates = np.abs(np.diff(targets, axis=0)).max(axis=1) * policy.rate_hz
    times = np.array([inputs.time_s for inputs in seen[1:]])
    assert rates[times >= AT_S].max() <= robot.description.target_rate_rad_s
    pitch = [-2.0 * (x * z - w * y) for w, x, y, z in (seen[-1].sensed.quaternion,)]
    assert pitch[0] == pytest.approx(0.1, abs=0.05)
    lowest, default = (
        policy.live_settings["body_height_m"].lowest,
        policy.live_settings["body_height_m"].default,
    )
    height = trace.base_position[-40:, 2].mean()
    assert lowest - 0.03 < height < 0.5 * (lowest + default)
