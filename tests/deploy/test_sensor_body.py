"""Checks of the base: the IMU's readings agree with each other, its height and attitude with the legs."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sensor_readings import PER_WINDOW, STILL, BodyWindows

from footfall.deploy.clearance import Clearance
from footfall.deploy.config import deploy_config
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.sensor_checks import imu
from footfall.plant.ground_truth import COLLAPSED_SHARE
from footfall.robots.description import Robot, available_robots, load_robot

ATTITUDES = Rotation.random(3, random_state=2).as_quat(scalar_first=True).tolist()


def about(axis: str, angle_rad: float) -> tuple[float, float, float, float]:
    """The quaternion of a turn."""
    return tuple(Rotation.from_euler(axis, angle_rad).as_quat(scalar_first=True).tolist())


def test_the_difference_to_the_gyro_adds_up_and_fades(go1: Robot) -> None:
    """The base turns by 0.05 rad at once; from then on the gyro reports 0.5 rad/s about another axis."""
    windows, kept = BodyWindows(go1, imu.Rotation), math.exp(-0.04 / 0.25)
    reading = STILL._replace(gyro=(0.0, 0.5, 0.0), quaternion=about("x", 0.05))
    found = [windows.update(reading) for _ in range(2)]
    expected = math.hypot(0.05, 0.01), math.hypot(kept * 0.05, kept * 0.01 + 0.02)
    assert found == pytest.approx(expected, abs=1e-4)


def test_readings_of_the_imu_that_repeat_themselves_count_while_the_body_moves(go1: Robot) -> None:
    """An acceleration counts half where the body does not turn; gyro and quaternion where the other turns.

    The joints move at 1 rad/s for two windows.
    """

    def turning(k: int) -> Inertial:
        """Only the quaternion turns, about z at 0.1 rad/s."""
        return STILL._replace(quaternion=about("z", 0.1 * k * 0.004))

    for check, reading, expected_s in (
        (imu.AccelerationRepeated, turning, 0.08),
        (imu.AccelerationRepeated, lambda _: STILL, 0.04),
        (imu.GyroRepeated, lambda _: STILL, 0.0),
        (imu.GyroRepeated, lambda k: turning(k)._replace(gyro=(0.0, 0.0, 0.1)), 0.0),  # steady
        (imu.GyroRepeated, turning, 0.08),
        (imu.QuaternionRepeated, lambda _: STILL, 0.0),
        (imu.QuaternionRepeated, lambda k: STILL._replace(gyro=(0.0, 0.1 + 0.001 * (k % 2), 0.0)), 0.08),
    ):
        windows = BodyWindows(go1, check, reading(0))
        for first in (1, PER_WINDOW + 1):
            repeated_s = windows.update(*map(reading, range(first, first + PER_WINDOW)), speed_rad_s=1.0)
        assert repeated_s == pytest.approx(expected_s), check


@pytest.mark.parametrize("quaternion", ATTITUDES)
class TestGravity:
    def test_in_motion_the_mean_acceleration_counts(self, go1: Robot, quaternion: list[float]) -> None:
        """The mean is over 1 s, a window takes 40 ms. Before, acceleration was the opposite of gravity."""
        acceleration = np.array([3.0, -5.0, 7.0])
        reading = Inertial((0.0,) * 3, tuple(acceleration), tuple(quaternion))
        world = Rotation.from_quat(quaternion, scalar_first=True).apply(acceleration)
        kept = math.exp(-0.04)
        lean, lift = (BodyWindows(go1, check).update(reading) for check in (imu.LateralError, imu.Lift))
        assert lean == pytest.approx((1 - kept) * math.hypot(world[0], world[1]) / 9.81)
        assert lift == pytest.approx((1 - kept) * abs(world[2] / 9.81 - 1.0))

    def test_at_rest_the_mean_of_all_windows_counts(self, go1: Robot, quaternion: list[float]) -> None:
        """Four windows of one reading and four windows of another reading take 0.32 s; 0.3 s are required."""
        windows, world = BodyWindows(go1, imu.RestError), np.array([[1.0, 2.0, 9.0], [3.0, -1.0, 12.0]])
        acceleration = Rotation.from_quat(quaternion, scalar_first=True).inv().apply(world)
        readings = [Inertial((0.0,) * 3, tuple(each), tuple(quaternion)) for each in acceleration]
        errors = [windows.update(readings[k // 4]) for k in range(8)]
        expected = np.linalg.norm([2.0, 0.5, 10.5 - 9.81]) / 9.81
        assert errors == pytest.approx([0.0] * 7 + [expected])


@pytest.mark.parametrize("name", available_robots())
def test_a_level_robot_has_sunk_before_a_simulator_calls_it_fallen(name: str) -> None:
    """Otherwise a run could end in an orderly way after a fall that the robot did not notice."""
    robot = load_robot(name)
    folded = robot.lying_pose
    if folded is None:  # a biped: its knees are at their limit
        folded = robot.default_pose.copy()
        for part, angle_rad in {"hip_pitch": -1.9, "knee": 2.8, "ankle_pitch": -0.9}.items():
            folded[[part in joint for joint in robot.joint_names]] = angle_rad

    # The least height of a robot that the simulator does not call fallen.
    least_m = COLLAPSED_SHARE * robot.description.standing_height_m
    poses = np.linspace(robot.default_pose, folded, 1001)
    collapsed = next(each for each in poses if -robot.legs.pose(each).foot[:, 2].min() < least_m)
    sunk_share = Clearance(robot).sunk_share(collapsed, STILL.quaternion)
    assert sunk_share > deploy_config(robot).safety.sensors.sunk
