"""The monitor of readings and checks of the base: limit of each row, times of comparison, adding a check."""

import math
from typing import Any, ClassVar

import numpy as np
import pytest
from changed_robots import with_each_motor
from scipy.spatial.transform import Rotation
from sensor_readings import PER_WINDOW, SAMPLE_US, STILL, BodyWindows

from footfall.deploy.clearance import Clearance
from footfall.deploy.config import deploy_config
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.modes import Mode
from footfall.deploy.sensor_checks import imu
from footfall.deploy.sensor_checks.check import JointCheck, Limit
from footfall.deploy.sensor_checks.joint_window import JointWindow, JointWindows
from footfall.deploy.sensor_checks.monitor import SensorMonitor
from footfall.deploy.sensor_checks.table import JOINT_CHECKS, SensorLimits
from footfall.deploy.signals import Implausible
from footfall.deploy.wiring import wiring_of
from footfall.plant.ground_truth import COLLAPSED_SHARE
from footfall.robots.description import Robot, available_robots, load_robot

VELOCITY, TORQUE, TEMPERATURE, VOLTAGE = range(1, 5)  # rows of readings, after positions
CALF = 2  # FR_calf_joint (can0, id 3): 35.55 N m, 20.06 rad/s
WIDE_LIMITS = SensorLimits(drift_rad=6.0, wander_rad=6.0, creep_rad=6.0, stuck_rad=6.0, unexplained=10.0)
ZEROS, NAN = np.zeros(12), np.full((2, 12), math.nan)
NOTHING_SENT = np.zeros((5, 12)), np.zeros((5, 12)), [ZEROS]


def monitor_of(robot: Robot, **checks: object) -> SensorMonitor:
    """A monitor that began with a robot that stands still."""
    monitor = SensorMonitor(robot, wiring_of(robot), WIDE_LIMITS, 0.002, **checks)  # type: ignore[arg-type]
    joints = np.array([robot.default_pose, ZEROS, ZEROS])
    monitor.begin(0, np.zeros(12, np.int64), STILL, joints, robot.default_pose)
    return monitor


def window(
    monitor: SensorMonitor, joints: np.ndarray, number: int = 0, health: Any = NAN
) -> Implausible | None:
    """Finding on the joints in one window of constant readings; `health`: temperatures and voltages."""
    for now_us in SAMPLE_US * np.arange(10 * number + 1, 10 * number + 11):
        full = monitor.add(int(now_us), 0, np.full(12, now_us), STILL, joints, *NOTHING_SENT)
    assert full
    return monitor.joint_contradiction(ZEROS, joints[0], *health)


def found(robot: Robot, row: int = VELOCITY, value: float = 0.0) -> str:
    """Findings for a robot that stands still, with one changed value of one motor."""
    readings = np.array([robot.default_pose, ZEROS, ZEROS, *NAN])
    readings[row, CALF] = value
    implausible = window(monitor_of(robot), readings[:3], health=readings[3:])
    assert implausible is None or implausible.leads_to is Mode.ESTOP
    return "" if implausible is None else implausible.fault


class TestFigures:
    def test_a_motors_limits_bound_its_readings(self, go1: Robot) -> None:
        for row, allowed, beyond, message in (
            (VELOCITY, -1.49 * 20.06, -1.51 * 20.06, "30.3 rad/s"),
            (TORQUE, 1.19 * 35.55, 1.21 * 35.55, "43.0 N m"),
            (TORQUE, -1.19 * 35.55, -1.21 * 35.55, "43.0 N m"),
            (TEMPERATURE, 85.0, 86.0, "86 degrees Celsius"),
        ):
            assert found(go1, row, allowed) == ""
            fault = found(go1, row, beyond)
            assert fault.startswith("FR_calf_joint (can0, id 3)")
            assert message in fault
        assert found(go1, TORQUE, math.nan).startswith("FR_calf_joint")

    def test_a_supply_has_to_be_in_the_motors_range(self, go1: Robot) -> None:
        ranged = with_each_motor(go1, voltage_v=(10.0, 14.8))
        assert found(ranged) == ""  # its voltage and temperature are NaN: not reported
        for voltage, off in ((9.5, "0.5 V"), (10.0, ""), (14.8, ""), (16.8, "2.0 V")):
            fault = found(ranged, VOLTAGE, voltage)
            assert off in fault if off else fault == ""
            assert found(go1, VOLTAGE, voltage) == ""  # without a range


class Twitch(JointCheck):
    """A made-up check: the sum of a joint's speeds."""

    quantity = "how much a joint twitches"
    message = "twitches by {0:.1f} rad/s"
    limit = Limit("speed_share")  # 1.5
    leads_to: ClassVar[Mode] = Mode.FALLING

    def reset(self) -> None:
        self.sum = ZEROS

    def measure(self, window: JointWindow) -> np.ndarray:
        self.sum = self.sum + window.speed
        return self.sum


def test_a_made_up_check_is_judged_and_reset(go1: Robot) -> None:
    moving = np.array([go1.default_pose, ZEROS + 1.0 * (np.arange(12) == CALF), ZEROS])
    monitor = monitor_of(go1, joint_checks=(*JOINT_CHECKS, Twitch))
    assert window(monitor, moving) is None
    twitches = Implausible("FR_calf_joint (can0, id 3): twitches by 2.0 rad/s", Mode.FALLING)
    assert window(monitor, moving, number=1) == twitches
    monitor.begin(20 * SAMPLE_US, np.full(12, 20 * SAMPLE_US), STILL, moving, moving[0])
    assert window(monitor, moving, number=2) is None


def test_a_gap_of_half_or_1_5_periods() -> None:
    for period_s, longest_us in ((0.04, 20_000), (0.004, 6000)):
        for silence_us, compared in ((longest_us, True), (longest_us + 1, False)):
            windows, times_us = (
                JointWindows(12, SensorLimits(period_s=period_s), 0.002),
                np.full(12, SAMPLE_US),
            )
            windows.add(SAMPLE_US, silence_us, times_us, STILL, np.zeros((3, 12)), *NOTHING_SENT)
            assert (windows.close(ZEROS, ZEROS, ZEROS, ZEROS) is not None) is compared


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
    """An acceleration counts half where the body does not turn; gyro and quaternion where the other turns."""

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
        for first in (1, PER_WINDOW + 1):  # two windows in which the joints move
            repeated_s = windows.update(*map(reading, range(first, first + PER_WINDOW)), speed_rad_s=1.0)
        assert repeated_s == pytest.approx(expected_s), check


@pytest.mark.parametrize("quaternion", Rotation.random(3, random_state=2).as_quat(scalar_first=True).tolist())
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
