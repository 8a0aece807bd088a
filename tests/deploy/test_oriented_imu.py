"""A robot whose IMU gives no orientation stands, walks and is pushed, with the filter's attitude."""

from dataclasses import replace

import numpy as np
import pytest
from deploy_policies import Hold, short_episode

from footfall.common.rotations import rotation_matrix
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import open_imu
from footfall.deploy.loop import ControlLoop
from footfall.deploy.wiring import wiring_of
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.imu_ends import open_imu_end
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot

AT_REST = imu.Inertial((0.01, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0))


def without_orientation(robot: Robot) -> Robot:
    """The same robot with an IMU that has gyro and accelerometer alone."""
    return replace(robot, description=replace(robot.description, imu_protocol="footfall-inertial"))


def test_its_tilt_is_right_within_a_degree(go1: Robot) -> None:
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
    """Its gyro reads 0.2 rad/s, which the filter would mistake for the bias."""
    episode = short_episode(sample={"gyro_bias": np.array([0.0, 0.2, 0.0])})
    robot = without_orientation(go1)
    trace = run_episode(robot, Hold(robot), episode)
    assert trace.faults
    assert not len(trace.time_s)


def test_an_unexpected_quaternion_is_ignored(go1: Robot) -> None:
    """An IMU that lies on its side sends the quaternion of a level one."""
    on_side = AT_REST._replace(acceleration=(0.0, 9.81, 0.0))
    reader, end = open_imu(wiring_of(without_orientation(go1))), open_imu_end(wiring_of(go1))
    for tick in range(400):
        reader.absorb(end.encode(on_side), 2000 * tick)
    up = rotation_matrix(np.array(reader.reading.quaternion))[2]
    np.testing.assert_allclose(up, [0.0, 1.0, 0.0], atol=1e-3)


def test_readings_begin_after_a_rest_and_age_when_samples_repeat(go1: Robot) -> None:
    wiring = wiring_of(without_orientation(go1))
    reader, end = open_imu(wiring), open_imu_end(wiring)
    times_us = []
    for tick in range(400):
        frames = end.encode(AT_REST)
        reader.absorb(frames, 2000 * tick)
        times_us.append(reader.arrived_us)
    assert times_us[100] is None
    assert times_us[-1] == 2000 * 399
    reader.absorb(frames, 900_000)
    assert reader.arrived_us == 2000 * 399
