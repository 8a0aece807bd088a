"""The attitude of a base by its legs against that by its IMU, while the robot stands nearly still."""

import math

import numpy as np
import pytest

from footfall.deploy.leg_attitude import LegAttitude
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.policies.controllers.stance import level_feet
from footfall.robots.description import Robot, load_robot

LIMITS = SensorLimits()
LOOK_S = 0.04
LEVEL = np.array([0.0, 0.0, 1.0])
ALL = np.ones(4)


def nose_up(angle: float) -> np.ndarray:
    """The upward direction in the axes of a base that is pitched back: its x component is the sine."""
    return np.array([math.sin(angle), 0.0, math.cos(angle)])


def swayed(robot: Robot, roll: float, pitch: float) -> np.ndarray:
    """Joint positions (n,) of a robot whose base is turned over feet that stay."""
    legs = robot.legs
    feet = level_feet(legs.default_foot, -np.array([roll, pitch]))
    return legs.scatter(legs.solve(feet), robot.default_pose)


class Stander:
    """A robot at rest, the upward direction by the IMU, and each foot's share of an even load."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.attitude = robot, LegAttitude(robot, LIMITS)
        self.even_n = 9.81 * robot.legs.mass / robot.legs.count

    def update(self, up: np.ndarray, position: np.ndarray | None = None, loads: np.ndarray = ALL) -> None:
        legs = self.robot.legs
        position = self.robot.default_pose if position is None else position
        pressed = loads[:, None] * self.even_n * up
        torque = legs.holding_torque(position, 9.81 * up) + legs.torque(legs.pose(position).jacobian, pressed)
        joints = legs.scatter(torque, np.zeros(len(position)))
        self.attitude.update(position, joints, up, LOOK_S)

    def looks(self, *args: object) -> LegAttitude:
        """Until it has settled."""
        for _ in range(2 + round(LIMITS.resting_s / LOOK_S)):
            self.update(*args)  # type: ignore[arg-type]
        return self.attitude


@pytest.fixture
def stander(go1: Robot) -> Stander:
    return Stander(go1)


@pytest.mark.parametrize("angle", [0.0, 0.2, -0.5])
def test_on_a_slope_both_attitudes_differ_by_its_angle(stander: Stander, angle: float) -> None:
    attitude = stander.looks(nose_up(angle))
    assert attitude.slope == pytest.approx(abs(angle), abs=1e-3)
    assert attitude.turn == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_a_base_that_turns_without_its_legs_is_a_contradiction(stander: Stander, slope: float) -> None:
    stander.looks(nose_up(slope))
    stander.update(nose_up(slope + 0.1))
    assert stander.attitude.turn == pytest.approx(0.1, rel=1e-3)


@pytest.mark.parametrize(("roll", "pitch"), [(0.1, 0.0), (0.0, -0.1)])
def test_a_sway_by_the_legs_must_show_in_the_imu(stander: Stander, roll: float, pitch: float) -> None:
    position = swayed(stander.robot, roll, pitch)
    stander.looks(LEVEL)
    stander.update(LEVEL, position)
    assert stander.attitude.turn == pytest.approx(0.1, abs=0.005)
    really = np.array([-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)])
    stander.update(really, position)
    assert stander.attitude.turn == pytest.approx(0.0, abs=0.005)


@pytest.mark.parametrize(
    "loads",
    [np.zeros(4), np.array([1.0, 0.0, 0.0, 1.0]), np.array([2.0, 2.0, 0.1, 0.1])],
    ids=["it hangs", "a diagonal", "two carry a tenth"],
)
def test_fewer_than_three_loaded_feet_give_no_estimate(stander: Stander, loads: np.ndarray) -> None:
    attitude = stander.looks(nose_up(0.5), None, loads)
    stander.update(nose_up(0.9), None, loads)
    assert (attitude.slope, attitude.turn) == (0.0, 0.0)


def test_three_collinear_feet_and_two_soles_give_no_estimate() -> None:
    """Of six feet those of one side; soles of a biped may tip over their edges."""
    robot = load_robot("hexapod")
    left = np.array([foot.name.startswith("L") for foot in robot.description.feet])
    assert Stander(robot).looks(nose_up(0.3), None, 2.0 * left).slope == 0.0
    assert Stander(robot).looks(nose_up(0.3), None, 1.0 + left).slope == pytest.approx(0.3, abs=1e-3)
    attitude = Stander(load_robot("g1")).looks(nose_up(0.5), None, np.ones(2))
    assert (attitude.slope, attitude.turn) == (0.0, 0.0)
