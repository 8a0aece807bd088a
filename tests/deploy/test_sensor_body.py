"""Checks of the base.

They compare the IMU's readings with each other, and the base's height and attitude with the legs.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation as ScipyRotation
from sensor_readings import PER_WINDOW, STILL, BodyWindows

from footfall.deploy.clearance import Clearance
from footfall.deploy.config import deploy_config
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.sensor_checks.imu import (
    AccelerationRepeated,
    GyroRepeated,
    LateralError,
    Lift,
    QuaternionRepeated,
    RestError,
    Rotation,
)
from footfall.plant.ground_truth import COLLAPSED_SHARE
from footfall.robots.description import Robot, available_robots, load_robot

ATTITUDES = ScipyRotation.random(3, random_state=2).as_quat(scalar_first=True).tolist()
LEVEL = (1.0, 0.0, 0.0, 0.0)


def about(axis: str, angle_rad: float) -> tuple[float, float, float, float]:
    """The quaternion of a turn."""
    return tuple(ScipyRotation.from_euler(axis, angle_rad).as_quat(scalar_first=True).tolist())


def test_the_difference_to_the_gyro_adds_up_and_fades(go1: Robot) -> None:
    """The base turns by 0.05 rad at once; from then on the gyro reports 0.5 rad/s about another axis."""
    windows = BodyWindows(go1, Rotation)
    reading = Inertial((0.0, 0.5, 0.0), (0.0, 0.0, 9.81), about("x", 0.05))
    assert windows.update(reading) == pytest.approx(math.hypot(0.05, 0.01), abs=1e-4)
    kept = math.exp(-0.04 / 0.25)
    expected = math.hypot(kept * 0.05, kept * 0.01 + 0.02)
    assert windows.update(reading) == pytest.approx(expected, abs=1e-4)


class TestRepeated:
    """Time for which a reading has repeated itself after two windows of joints that move at 1 rad/s."""

    def repeated(self, robot: Robot, check: Any, reading: Callable[[int], Inertial], **more: Any) -> float:
        windows = BodyWindows(robot, check, reading(0))
        for window in range(2):
            samples = range(PER_WINDOW * window + 1, PER_WINDOW * (window + 1) + 1)
            value = windows.update(*map(reading, samples), **{"speed_rad_s": 1.0, **more})
        return value

    @staticmethod
    def turning(k: int) -> Inertial:
        """A window in which only the quaternion turns, about z at 0.1 rad/s: by 0.004 rad."""
        return STILL._replace(quaternion=about("z", 0.1 * k * 0.004))

    def test_an_acceleration_counts_half_where_the_body_does_not_turn(self, go1: Robot) -> None:
        assert self.repeated(go1, AccelerationRepeated, self.turning) == pytest.approx(0.08)
        assert self.repeated(go1, AccelerationRepeated, lambda _: STILL) == pytest.approx(0.04)

    def test_a_frozen_gyro_or_quaternion_counts_where_the_other_turns(self, go1: Robot) -> None:
        for check in (GyroRepeated, QuaternionRepeated):
            assert self.repeated(go1, check, lambda _: STILL) == 0.0
        steady = lambda k: self.turning(k)._replace(gyro=(0.0, 0.0, 0.1))  # noqa: E731
        assert self.repeated(go1, GyroRepeated, steady) == 0.0
        assert self.repeated(go1, GyroRepeated, self.turning) == pytest.approx(0.08)
        stuck = lambda k: STILL._replace(gyro=(0.0, 0.1 + 0.001 * (k % 2), 0.0))  # noqa: E731
        assert self.repeated(go1, QuaternionRepeated, stuck) == pytest.approx(0.08)


class TestGravity:
    @pytest.mark.parametrize("quaternion", ATTITUDES)
    def test_in_motion_the_mean_acceleration_counts(self, go1: Robot, quaternion: list[float]) -> None:
        """The mean is over 1 s, a window takes 40 ms. Before, acceleration was the opposite of gravity."""
        acceleration = np.array([3.0, -5.0, 7.0])
        reading = Inertial((0.0,) * 3, tuple(acceleration), tuple(quaternion))
        world = ScipyRotation.from_quat(quaternion, scalar_first=True).apply(acceleration)
        kept = math.exp(-0.04)
        lean, lift = (BodyWindows(go1, check).update(reading) for check in (LateralError, Lift))
        assert lean == pytest.approx((1 - kept) * math.hypot(world[0], world[1]) / 9.81)
        assert lift == pytest.approx((1 - kept) * abs(world[2] / 9.81 - 1.0))

    @pytest.mark.parametrize("quaternion", ATTITUDES)
    def test_at_rest_the_mean_of_all_windows_counts(self, go1: Robot, quaternion: list[float]) -> None:
        """Four windows of one reading and four windows of another reading take 0.32 s; 0.3 s are required."""
        windows, world = BodyWindows(go1, RestError), np.array([[1.0, 2.0, 9.0], [3.0, -1.0, 12.0]])
        acceleration = ScipyRotation.from_quat(quaternion, scalar_first=True).inv().apply(world)
        errors = [
            windows.update(Inertial((0.0,) * 3, tuple(acceleration[k // 4]), tuple(quaternion)))
            for k in range(8)
        ]
        expected = np.linalg.norm([2.0, 0.5, 10.5 - 9.81]) / 9.81
        assert errors == pytest.approx([0.0] * 7 + [expected])


@pytest.mark.parametrize("name", available_robots())
def test_a_level_robot_has_sunk_before_a_simulator_calls_it_fallen(name: str) -> None:
    """Otherwise a run could end in an orderly way after a fall that the robot did not notice."""
    robot = load_robot(name)
    # A biped with its knees at their limit.
    squat = {"hip_pitch": -1.9, "knee": 2.8, "ankle_pitch": -0.9}
    folded = robot.lying_pose
    if folded is None:
        folded = np.array(
            [
                next((rad for part, rad in squat.items() if part in joint), default)
                for joint, default in zip(robot.joint_names, robot.default_pose, strict=True)
            ]
        )

    def pose(share: float) -> np.ndarray:
        return robot.default_pose + share * (folded - robot.default_pose)

    least = COLLAPSED_SHARE * robot.description.standing_height_m
    share = next(
        share
        for share in np.linspace(0.0, 1.0, 1001)
        if -robot.legs.pose(pose(share)).foot[:, 2].min() < least  # as the simulator measures it
    )
    assert Clearance(robot).sunk_share(pose(share), LEVEL) > deploy_config(robot).safety.sensors.sunk
