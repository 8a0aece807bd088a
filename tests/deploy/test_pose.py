"""Whether joints can be at the positions that their encoders report at the start of a run."""

import math
from dataclasses import replace

import numpy as np
import pytest

from footfall.deploy.pose import impossible_pose
from footfall.robots.description import Robot

LABELS = [f"joint {joint}" for joint in range(12)]
TURN = math.tau


def found(robot: Robot, position: float, lower: float, upper: float, margin_rad: float = 0.0) -> str:
    """Finding for joint 4 at a position with this range; the others are in the default pose."""
    joint = np.arange(12) == 4
    ranged = replace(
        robot,
        lower_rad=np.where(joint, lower, robot.lower_rad),
        upper_rad=np.where(joint, upper, robot.upper_rad),
    )
    return impossible_pose(ranged, LABELS, np.where(joint, position, robot.default_pose), margin_rad)


@pytest.mark.parametrize(
    ("position", "turns"),
    [
        (1.5 + TURN, "+1 turn of the joint (+6.28 rad)"),
        (1.95 + TURN, "+1 turn of the joint (+6.28 rad)"),
        (1.5 + 2 * TURN, "+2 turns of the joint (+12.57 rad)"),
        (1.5 - TURN, "-1 turn of the joint (-6.28 rad)"),
        (2.05 + TURN, ""),  # above the range; a turn less is below it
        (0.95 - TURN, ""),
        (math.nan, ""),
        (math.inf, ""),
    ],
)
def test_a_position_may_be_off_by_whole_turns_alone(go1: Robot, position: float, turns: str) -> None:
    """The joint's range is 1 to 2 rad."""
    fault = found(go1, position, 1.0, 2.0)
    assert fault.startswith("joint 4 reads")
    assert turns in fault
    assert ("of the joint" in fault) is bool(turns)


def test_a_joint_off_by_a_turn_of_its_rotor_is_reported(go1: Robot) -> None:
    """A hip's gear ratio is 6.33.

    One turn of the rotor is 0.99 rad, less than the joint's range of 1.7 rad.
    """
    gear = go1.motor_figures("gear_ratio")[0]
    position = go1.default_pose.copy()
    position[0] = go1.upper_rad[0] + 0.5
    fault = impossible_pose(go1, LABELS, position, 0.1)
    assert fault.endswith(f"off by +1 turn of its rotor (+{TURN / gear:.2f} rad)?")
