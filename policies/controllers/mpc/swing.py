"""The path of a foot through the air."""

from typing import NamedTuple

import numpy as np

from footfall.policies.controllers.gait import cycloid, hump
from footfall.policies.controllers.mpc.config import SwingConfig


class SwingTarget(NamedTuple):
    """Motion of the feet's centres, each (legs, 3)."""

    position: np.ndarray  # m
    velocity: np.ndarray  # m/s
    acceleration: np.ndarray  # m/s^2


def swing_target(
    progress: np.ndarray,
    lift_off: np.ndarray,
    landing: np.ndarray,
    swing_s: float,
    config: SwingConfig,
) -> SwingTarget:
    """Cycloid from lift-off to landing with a hump above it.

    Args:
        progress: (legs,) share of the swing that is over, in [0, 1].
        lift_off, landing: (legs, 3) m, centres of the feet, world frame.
        swing_s: how long a swing takes.
        config: height of the hump.
    """
    along, above = cycloid(progress), hump(progress)
    way = landing - lift_off
    position = lift_off + along.value[:, None] * way
    velocity = (along.slope / swing_s)[:, None] * way
    acceleration = (along.bend / swing_s**2)[:, None] * way
    position[:, 2] += config.height_m * above.value
    velocity[:, 2] += config.height_m * above.slope / swing_s
    acceleration[:, 2] += config.height_m * above.bend / swing_s**2
    return SwingTarget(position, velocity, acceleration)
