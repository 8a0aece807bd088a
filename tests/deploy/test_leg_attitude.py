"""The attitude of a base by its legs against that by its IMU, while the robot stands nearly still."""

import math

import numpy as np
import pytest
from moments import UP, under_load

from footfall.deploy.leg_attitude import LegAttitude
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.robots.description import Robot

LIMITS = SensorLimits()
PERIOD_S = 0.04
ALL = np.ones(4)


def nose_up(angle: float) -> np.ndarray:
    """The upward direction in the axes of a base that is pitched back: its x component is the sine."""
    return np.array([math.sin(angle), 0.0, math.cos(angle)])


class Stander:
    """A robot at rest, the upward direction by the IMU, and each foot's share of an even load."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.attitude = robot, LegAttitude(robot, LIMITS)

    def update(self, up: np.ndarray, loads: np.ndarray = ALL) -> None:
        even_n = 9.81 * self.robot.legs.mass / self.robot.legs.count
        sensed = under_load(self.robot, loads[:, None] * even_n * up, 9.81 * up)
        self.attitude.update(sensed.joint_position, sensed.joint_torque, up, PERIOD_S)

    def settle(self, up: np.ndarray) -> LegAttitude:
        """Update until the estimate has settled."""
        for _ in range(2 + round(LIMITS.resting_s / PERIOD_S)):
            self.update(up)
        return self.attitude


@pytest.fixture
def stander(go1: Robot) -> Stander:
    return Stander(go1)


@pytest.mark.parametrize("angle", [0.0, 0.2, -0.5])
def test_on_a_slope_both_attitudes_differ_by_its_angle(stander: Stander, angle: float) -> None:
    attitude = stander.settle(nose_up(angle))
    assert attitude.slope == pytest.approx(abs(angle), abs=1e-3)
    assert attitude.turn == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_a_base_that_turns_without_its_legs_is_a_contradiction(stander: Stander, slope: float) -> None:
    stander.settle(nose_up(slope))
    stander.update(nose_up(slope + 0.1))
    assert stander.attitude.turn == pytest.approx(0.1, rel=1e-3)


def test_three_other_feet_start_a_new_comparison(stander: Stander) -> None:
    three = np.array([1.0, 1.0, 1.0, 0.0])
    stander.settle(UP)
    stander.update(nose_up(0.1), three)
    assert stander.attitude.turn == 0.0
    stander.update(nose_up(0.3), three)
    assert stander.attitude.turn == pytest.approx(0.2, rel=1e-2)
