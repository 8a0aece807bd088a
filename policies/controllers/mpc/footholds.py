"""Where swinging feet should land."""

import numpy as np

from footfall.common.rotations import cross
from footfall.policies.controllers.mpc.config import FootholdConfig

GRAVITY = 9.81


def footholds(
    base: np.ndarray,
    velocity: np.ndarray,
    wanted_velocity: np.ndarray,
    yaw: float,
    yaw_rate: float,
    places: np.ndarray,
    swing_left_s: np.ndarray,
    stance_s: float,
    config: FootholdConfig,
) -> np.ndarray:
    """Touch-down points of all feet on the ground, world frame, m (legs, 3), z = 0.

    Raibert's symmetric step with a capture-point and a centrifugal term (Bledt et al. 2018, eq. 11):

        place under the body at touch-down + v T_stance / 2 + k (v - v_wanted) + (z/g) v x w / 2

    The feedback gain k acts on both axes alike: it is a time, not scaled by any control period.

    Args:
        base: (3,) base origin, world; its z is the height above the ground.
        velocity: (3,) of the base, world.
        wanted_velocity: (3,) commanded, world.
        yaw: heading, rad.
        yaw_rate: commanded, rad/s.
        places: (legs, 3) feet of the nominal stance from the base, heading frame.
        swing_left_s: (legs,) time to touch-down.
        stance_s: time that the foot will stand.
        config: gain, and the farthest that a foot may land from its place under the body.
    """
    turn = np.array([0.0, 0.0, yaw_rate])
    landing_yaw = yaw + yaw_rate * swing_left_s
    cos, sin = np.cos(landing_yaw), np.sin(landing_yaw)
    arm = np.zeros_like(places)
    arm[:, 0] = cos * places[:, 0] - sin * places[:, 1]
    arm[:, 1] = sin * places[:, 0] + cos * places[:, 1]
    step = 0.5 * stance_s * (velocity + cross(turn, arm))
    step += config.capture_gain_s * (velocity - wanted_velocity)
    step += 0.5 * (base[2] / GRAVITY) * cross(velocity, turn)
    reach = np.hypot(step[:, 0], step[:, 1])
    step *= np.minimum(1.0, config.most_step_m / np.maximum(reach, 1e-9))[:, None]
    target = base + velocity * swing_left_s[:, None] + arm + step
    target[:, 2] = 0.0
    return target


def contact_points(
    contacts: np.ndarray,
    feet: np.ndarray,
    targets: np.ndarray,
    places: np.ndarray,
    centre: np.ndarray,
    yaw: np.ndarray,
) -> np.ndarray:
    """Where each foot stands during each step of the horizon, from the centre of mass then.

    A foot that stands now stays where it is, one that swings lands on its target, and one that has lifted off
    and landed once more by then is at its place under the body.

    Args:
        contacts: (steps, legs) boolean; the first step is now.
        feet: (legs, 3) present points of contact, heading frame.
        targets: (legs, 3) touch-down points, heading frame.
        places: (legs, 3) feet of the nominal stance from the base, heading frame.
        centre: (steps, 3) path of the centre of mass, heading frame, z above the ground.
        yaw: (steps,) heading along the path, rad.

    Returns:
        (steps, legs, 3) m.
    """
    changes = np.cumsum(contacts[1:] != contacts[:-1], axis=0)
    changes = np.concatenate([np.zeros((1, contacts.shape[1]), dtype=int), changes])
    first_change = np.where(contacts[0], 0, 1)  # changes up to the first stance
    point = np.where(contacts[0][:, None], feet, targets)[None] - centre[:, None, :]
    later = changes > first_change
    cos, sin = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    under = np.empty_like(point)
    under[:, :, 0] = cos * places[:, 0] - sin * places[:, 1]
    under[:, :, 1] = sin * places[:, 0] + cos * places[:, 1]
    under[:, :, 2] = -centre[:, 2:]
    return np.where(later[:, :, None], under, point)
