"""A robot whose IMU gives no orientation stands, walks and is pushed, with the filter's attitude."""

import numpy as np
import pytest
from changed_robots import described
from deploy_policies import Hold, short_episode

from footfall import Episode, Push, Robot, load_policy, run_episode
from footfall.common.rotations import rotation_matrix
from footfall.deploy.loop import ControlLoop
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.robot import SimulatedRobot


def without_orientation(robot: Robot) -> Robot:
    """The same robot with an IMU that has gyro and accelerometer alone."""
    return described(robot, imu_protocol="footfall-inertial")


def test_the_tilt_is_right_within_a_degree(go1: Robot) -> None:
    """The gyro has a bias; the tilt's error is a root mean square."""
    robot, errors = without_orientation(go1), []

    def compare(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.walking:
            up = rotation_matrix(loop.sensed.quaternion)[2]
            errors.append(np.linalg.norm(up - rotation_matrix(body.truth().base_quaternion)[2]))

    episode = Episode(
        command_source=lambda _: np.array([0.8, 0.0, 0.3]),
        duration_s=2.0,
        sample={"gyro_bias": np.array([0.02, -0.015, 0.01])},
        noise=load_scenarios(robot).noise,
        pushes=(Push(0.6, (0.5, 0.0, 0.0)), Push(1.4, (0.0, -0.5, 0.0))),
    )
    trace = run_episode(robot, load_policy("go1-flat", robot), episode, compare)
    assert (trace.fell, trace.faults) == (False, ())
    assert np.degrees(np.sqrt(np.mean(np.square(errors)))) <= 1.0
    assert np.median(trace.base_velocity[50:, 0]) == pytest.approx(0.8, abs=0.2)


def test_a_robot_that_moves_at_first_may_not_stand_up(go1: Robot) -> None:
    """The robot's gyro reads 0.2 rad/s, which the filter would take for a bias."""
    episode = short_episode(sample={"gyro_bias": np.array([0.0, 0.2, 0.0])})
    robot = without_orientation(go1)
    trace = run_episode(robot, Hold(robot), episode)
    assert trace.faults
    assert not len(trace.time_s)
