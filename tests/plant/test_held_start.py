"""A robot that cannot stand still is held up, steps in place, is released, and is held again at the end."""

import numpy as np
import pytest
from changed_robots import described
from deploy_policies import FailingPolicy, Hold

from footfall import Episode, JointCommand, Robot, run_episode
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.plant.robot import SimulatedRobot

COMMAND = np.array([0.4, 0.0, 0.1])


@pytest.fixture
def held(go1: Robot) -> Robot:
    """go1 with `held_start`, as a robot that cannot stand still."""
    return described(go1, held_start=True)


def without_gains(command: JointCommand) -> JointCommand:
    return command._replace(kp=0.0 * command.kp, kd=0.0 * command.kd)


def test_a_held_robot_does_not_sink_until_it_is_released(held: Robot, go1: Robot) -> None:
    config = DeployConfig(in_place_s=0.6)
    walked_s = {
        robot.description.held_start: run_episode(
            robot, FailingPolicy(robot, 0.0, without_gains), Episode(lambda _: COMMAND, 1.5, config=config)
        ).walked_s
        for robot in (held, go1)
    }
    assert 0.0 < walked_s[False] < 0.5
    assert 0.6 < walked_s[True] < 1.0


def test_a_held_robot_steps_in_place_at_first_and_before_the_end(held: Robot) -> None:
    config = DeployConfig(in_place_s=0.5, stop_s=0.3)
    policy = Hold(held)
    seen: list[tuple[Mode, bool]] = []

    def watch(loop: ControlLoop, _: SimulatedRobot) -> None:
        seen.append((loop.state.mode, loop.held_up))

    trace = run_episode(held, policy, Episode(lambda _: COMMAND, 1.0, config=config), watch)
    assert trace.final_state == Mode.IDLE
    commanded_s = [inputs.time_s for inputs in policy.seen if np.any(inputs.command != 0.0)]
    assert commanded_s[0] == pytest.approx(0.5, abs=0.021)
    assert commanded_s[-1] == pytest.approx(1.0, abs=0.021)
    assert policy.seen[-1].time_s == pytest.approx(1.3, abs=0.021)
    phases = list(dict.fromkeys(seen))
    assert phases[1:] == [
        (Mode.STANDING, True),
        (Mode.WALKING, True),
        (Mode.WALKING, False),
        (Mode.STOPPING, True),
        (Mode.RELEASING, False),
    ]
