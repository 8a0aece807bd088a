"""The table of sensor checks: which figure of the robot or the settings each row goes by."""

from dataclasses import replace

import numpy as np
import pytest

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.safety import Mode
from footfall.deploy.sensor_checks import BODY_CHECKS, JOINT_CHECKS, SensorChecks
from footfall.deploy.sensor_limits import SensorLimits
from footfall.deploy.wiring import wire
from footfall.robots.description import Robot

STILL = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0))
CALF = 2  # FR_calf_joint (can0, id 3): 35.55 N m, 20.06 rad/s


def found(robot: Robot, row: str = "", value: float = 0.0, limits: SensorLimits | None = None) -> str:
    """What is found of a robot that stands still, but for one figure of one motor."""
    checks = SensorChecks(
        robot, wire(robot), limits or SensorLimits(drift_rad=6.0, wander_rad=6.0, stuck_rad=6.0), 0.002
    )
    told = {name: np.zeros(12) for name in ("velocity", "torque")}
    told |= {name: np.full(12, np.nan) for name in ("temperature", "voltage")}
    if row:
        told[row][CALF] = value
    joints = np.array([robot.default_pose, told["velocity"], told["torque"]])
    zeros, heard_us = np.zeros(12), np.zeros(12, np.int64)
    checks.monitor.begin(0, heard_us, STILL, joints, robot.default_pose)
    for now_us in range(4000, 41_000, 4000):
        looks = checks.monitor.add(now_us, 0, heard_us + now_us, STILL, joints, zeros)
    assert looks
    assert checks.monitor.look(zeros, robot.default_pose, told["temperature"], told["voltage"])
    implausible = checks.of_joints()
    if implausible is None:
        return ""
    assert implausible.leads_to is Mode.ESTOP
    return implausible.fault


def with_motors(robot: Robot, **changes: object) -> Robot:
    description = robot.description
    motors = {name: replace(motor, **changes) for name, motor in description.motors.items()}  # type: ignore[arg-type]
    return replace(robot, description=replace(description, motors=motors))


@pytest.mark.parametrize(
    ("row", "allowed", "beyond", "says"),
    [
        ("velocity", -1.49 * 20.06, -1.51 * 20.06, "turns at 30.3 rad/s, faster than its motor can"),
        ("torque", 1.19 * 35.55, 1.21 * 35.55, "the motor reports 43.0 N m, more than it can"),
        ("torque", -1.19 * 35.55, -1.21 * 35.55, "the motor reports 43.0 N m, more than it can"),
        ("temperature", 85.0, 86.0, "the motor is at 86 degrees Celsius"),
    ],
)
def test_a_motors_figures_limit_what_it_may_report(
    go1: Robot, row: str, allowed: float, beyond: float, says: str
) -> None:
    assert found(go1, row, allowed) == ""
    assert found(go1, row, beyond) == f"FR_calf_joint (can0, id 3): {says}"


def test_the_limit_of_temperature_is_the_motors(go1: Robot) -> None:
    warm = with_motors(go1, temperature_limit_c=60.0)
    assert found(warm, "temperature", 60.0) == ""
    assert "61 degrees" in found(warm, "temperature", 61.0)


@pytest.mark.parametrize(("voltage", "says"), [(9.5, "0.5 V"), (10.0, ""), (14.8, ""), (16.8, "2.0 V")])
def test_a_supply_has_to_be_in_the_motors_range(go1: Robot, voltage: float, says: str) -> None:
    assert says in found(with_motors(go1, voltage_v=(10.0, 14.8)), "voltage", voltage)
    assert bool(says) == bool(found(with_motors(go1, voltage_v=(10.0, 14.8)), "voltage", voltage))
    assert found(go1, "voltage", voltage) == ""  # whose range nobody knows


def test_what_motors_do_not_tell_is_no_fault(go1: Robot) -> None:
    assert found(with_motors(go1, voltage_v=(10.0, 14.8))) == ""


def test_a_setting_scales_a_motors_figure(go1: Robot) -> None:
    strict = SensorLimits(drift_rad=6.0, wander_rad=6.0, stuck_rad=6.0, speed_share=1.0)
    assert "turns at" in found(go1, "velocity", 20.07, strict)
    assert found(go1, "velocity", 20.05, strict) == ""


def test_every_row_has_a_name_of_its_own_and_a_limit(go1: Robot) -> None:
    rows = (*JOINT_CHECKS, *BODY_CHECKS)
    assert len({row.looks_at for row in rows}) == len(rows)
    for row in rows:
        assert np.all(np.isfinite(row.limit.of(go1, SensorLimits())))
