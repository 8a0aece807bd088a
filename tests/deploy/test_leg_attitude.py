"""The attitude of a base by its legs against that by its IMU, while the robot stands nearly still."""

import math

import numpy as np
import pytest
from moments import under_load

from footfall.deploy.leg_attitude import LegAttitude
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.robots.description import Robot

LIMITS, PERIOD_S = SensorLimits(), 0.04


def update(attitude: LegAttitude, robot: Robot, pitch: float, *loads: float) -> None:
    """Readings at rest of a base that is pitched back; loads are the feet's shares of an even load."""
    up = np.array([math.sin(pitch), 0.0, math.cos(pitch)])
    even_n = 9.81 * robot.legs.mass / robot.legs.count
    sensed = under_load(robot, even_n * np.outer(loads or np.ones(4), up), 9.81 * up)
    attitude.update(sensed.joint_position, sensed.joint_torque, up, PERIOD_S)


def settled(robot: Robot, pitch: float) -> LegAttitude:
    attitude = LegAttitude(robot, LIMITS)
    for _ in range(2 + round(LIMITS.resting_s / PERIOD_S)):
        update(attitude, robot, pitch)
    return attitude


@pytest.mark.parametrize("angle", [0.0, 0.2, -0.5])
def test_both_attitudes_differ_by_the_angle_of_a_slope_or_by_a_turn(go1: Robot, angle: float) -> None:
    """A base that turns without its legs is a contradiction."""
    attitude = settled(go1, angle)
    assert attitude.slope == pytest.approx(abs(angle), abs=1e-3)
    assert attitude.turn == pytest.approx(0.0, abs=1e-9)
    update(attitude, go1, angle + 0.1)
    assert attitude.turn == pytest.approx(0.1, rel=1e-3)


def test_three_other_feet_start_a_new_comparison(go1: Robot) -> None:
    attitude = settled(go1, 0.0)
    update(attitude, go1, 0.1, 1.0, 1.0, 1.0, 0.0)
    assert attitude.turn == 0.0
    update(attitude, go1, 0.3, 1.0, 1.0, 1.0, 0.0)
    assert attitude.turn == pytest.approx(0.2, rel=1e-2)
