"""Whether joints can be at the positions that their encoders report at the start of a run."""

import math
from dataclasses import replace

import pytest

from footfall.deploy.pose import impossible_pose
from footfall.robots.description import Robot

LABELS = [f"joint {joint}" for joint in range(12)]
TURN = math.tau


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
    """The joint's range is 1 to 2 rad; the others are in the default pose."""
    lower, upper, pose = go1.lower_rad.copy(), go1.upper_rad.copy(), go1.default_pose.copy()
    lower[4], upper[4], pose[4] = 1.0, 2.0, position
    fault = impossible_pose(replace(go1, lower_rad=lower, upper_rad=upper), LABELS, pose, 0.0)
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
