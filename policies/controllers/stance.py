"""Positions of standing feet, and how they turn a tilted base back to level."""

from collections.abc import Mapping

import numpy as np

from footfall.common.errors import UserError
from footfall.common.rotations import vertical_in_body
from footfall.policies.policy import PolicyInput
from footfall.robots.description import Robot
from footfall.robots.kinematics import Legs


def nominal_feet(legs: Legs, height_m: float, outward_m: float, shift_m: float) -> np.ndarray:
    """Positions of the feet (legs, 3) in a level stance, base frame, m.

    Args:
        legs: legs whose feet in the default pose are the starting point.
        height_m: height of the base above the ground.
        outward_m: additional distance of each foot from the robot's median plane; a foot in that plane stays.
        shift_m: forward shift of all feet.
    """
    feet = legs.default_foot.copy()
    feet[:, 0] += shift_m
    feet[:, 1] += np.sign(feet[:, 1].round(6)) * outward_m
    feet[:, 2] = legs.foot_radius - height_m
    return feet


def require_in_reach(robot: Robot, feet: np.ndarray, settings: Mapping[str, float]) -> None:
    """Check that stretched legs are long enough for a stance.

    Args:
        robot: the robot.
        feet: (legs, 3) m, from `nominal_feet`.
        settings: lengths of the stance by name, m, for the message.

    Raises:
        UserError: a foot is farther from its leg's first joint than the leg is long.
    """
    legs = robot.legs
    away_m = np.linalg.norm(feet - [limb.anchor[0] for limb in legs.limbs], axis=1)
    leg = int((away_m - legs.reach).argmax())
    if away_m[leg] > legs.reach[leg]:
        given = ", ".join(f"{name} {value:g}" for name, value in settings.items())
        raise UserError(
            f"{given}: foot {robot.description.feet[leg].name} would be {away_m[leg]:.3g} m from its leg's"
            f" first joint, and the leg is {legs.reach[leg]:.3g} m long"
        )


def require_lift(robot: Robot, name: str, height_m: float) -> None:
    """Raise UserError for a height of a swing that exceeds the length of every leg."""
    longest_m = robot.legs.reach.max()
    if height_m > longest_m:
        raise UserError(f"{name} must be at most {longest_m:.3g}, the length of a leg, not {height_m:g}")


def tilt_correction(
    inputs: PolicyInput,
    gain: float,
    rate_gain_s: float,
    max_rad: float,
    desired: np.ndarray | None = None,
) -> np.ndarray:
    """Roll and pitch (2,), rad, of the plane through the feet that turns a tilted base back.

    The tilt is the deviation of gravity from the body's z axis; the gyro gives its rate.
    `desired` is the goal's roll and pitch (2,); None for level.
    """
    up_x, up_y, _ = vertical_in_body(inputs.sensed.quaternion)
    rates = inputs.sensed.gyro[:2].tolist()
    roll, pitch = (0.0, 0.0) if desired is None else desired.tolist()
    errors = (up_y - roll, -up_x - pitch)
    corrections = [gain * error + rate_gain_s * rate for error, rate in zip(errors, rates, strict=True)]
    return np.array([min(max(correction, -max_rad), max_rad) for correction in corrections])


def level_feet(feet: np.ndarray, tilt: np.ndarray) -> np.ndarray:
    """Feet (legs, 3) in the base frame, moved along z as if on a plane turned by `tilt` (roll, pitch).

    On the lower side the legs push down, so that the base turns back to level.
    """
    moved, (roll, pitch) = feet.copy(), tilt.tolist()
    moved[:, 2] += roll * feet[:, 1] - pitch * feet[:, 0]
    return moved
