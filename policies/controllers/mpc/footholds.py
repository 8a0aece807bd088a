"""Footholds of swing feet. Horizontal vectors are complex numbers x + i y: a rotation is a product."""

import cmath
from functools import cache

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.mpc.config import FootholdConfig


def foothold(
    position: complex,
    base: complex,
    height_m: float,
    velocity: complex,
    desired_velocity: complex,
    yaw: float,
    yaw_rate: float,
    remaining_s: float,
    stance_s: float,
    config: FootholdConfig,
) -> complex:
    """Touch-down position of a foot on the ground, world frame, m.

    Raibert's symmetric step with a capture-point and a centrifugal term (Bledt et al. 2018, eq. 11):

        position under the body at touch-down + v T_stance / 2 + k (v - v_desired) + (z/g) v x w / 2

    The feedback gain k is the same for both axes. It is a time and does not depend on the control period.

    Args:
        position: m, position of the foot in the nominal stance relative to the base, heading frame.
        base: m, position of the base's origin, world.
        height_m: z, height of the base above the ground.
        velocity: v, m/s, velocity of the base, world.
        desired_velocity: m/s, commanded velocity, world.
        yaw: heading, rad.
        yaw_rate: w, commanded yaw rate, rad/s.
        remaining_s: time until touch-down.
        stance_s: duration of the next stance.
        config: gain, and largest distance of a foothold from the nominal position under the body.
    """
    arm = position * cmath.rect(1.0, yaw + yaw_rate * remaining_s)
    step = 0.5 * stance_s * (velocity + 1j * yaw_rate * arm)
    step += config.capture_gain_s * (velocity - desired_velocity)
    step += 0.5 * (height_m / GRAVITY_M_S2) * (-1j * yaw_rate * velocity)
    step *= min(1.0, config.max_step_m / max(abs(step), 1e-9))
    return base + velocity * remaining_s + arm + step


def contact_points(
    contacts: np.ndarray,
    feet: np.ndarray,
    targets: np.ndarray,
    positions: np.ndarray,
    centre: np.ndarray,
    yaw: np.ndarray,
) -> np.ndarray:
    """Position of each foot during each step of the horizon, relative to the centre of mass at that step.

    A foot in stance stays where it is. A foot in swing lands on its target. A foot that lifts off and lands
    again within the horizon is then at its nominal position under the body.

    Args:
        contacts: (steps, legs) boolean; the first step is the current one.
        feet: (legs, 3) current contact points, heading frame.
        targets: (legs, 3) touch-down points, heading frame.
        positions: (legs, 3) nominal positions of the feet relative to the base, heading frame.
        centre: (steps, 3) path of the centre of mass, heading frame, z above the ground.
        yaw: (steps,) heading along the path, rad.

    Returns:
        (steps, legs, 3) m.
    """
    first = np.where(contacts[0][:, None], feet, targets)
    points = first - centre[:, None]
    has_moved = _has_moved(contacts.tobytes(), len(feet))
    turned = np.exp(1j * yaw)[:, None] * (positions[:, 0] + 1j * positions[:, 1])
    np.copyto(points[:, :, 0], turned.real, where=has_moved)
    np.copyto(points[:, :, 1], turned.imag, where=has_moved)
    np.copyto(points[:, :, 2], -centre[:, 2:], where=has_moved)
    return points


@cache
def _has_moved(contacts: bytes, legs: int) -> np.ndarray:
    """Whether each foot (steps, legs) has left the position of its first stance.

    The contacts are given as bytes, which `cache` can hash.
    """
    stands = np.frombuffer(contacts, dtype=bool).reshape(-1, legs)
    changes = np.cumsum(stands[1:] != stands[:-1], axis=0)
    return np.concatenate([np.zeros((1, legs), dtype=bool), changes > np.where(stands[0], 0, 1)])
