"""Example of an observation term: roll and pitch angles instead of the direction of gravity.

    footfall train --robot go1 --preset roll_pitch.yaml --out runs/roll_pitch
    footfall deploy runs/roll_pitch

The exported policy's contract contains the name `roll_pitch:roll_pitch`. So Python must find this file where
the policy is deployed: in the working folder, or in an installed package.
"""

from typing import Annotated

import numpy as np

from footfall.common.terms import Between
from footfall.policies.contract import Contract
from footfall.policies.observation import Array, Inputs, observation_term
from footfall.robots.kinds import Kind
from footfall.robots.symmetry import Mirror

# Two values on every robot. In the mirror image, roll changes its sign.
ROLL_PITCH = Kind(lambda _: (2,), lambda _: Mirror(np.arange(2), np.array([-1.0, 1.0])))


@observation_term(ROLL_PITCH)
def roll_pitch(
    inputs: Inputs, contract: Contract, *, limit_rad: Annotated[float, Between(0.0, 3.2)] = 1.0
) -> Array:
    """Roll and pitch of the base, rad, (..., 2), clipped to +-limit_rad.

    The same function runs on JAX arrays in training and on NumPy arrays in deployment.
    """
    gravity = inputs.readings["gravity"]  # (..., 3), a unit vector in the body frame
    xp = gravity.__array_namespace__()
    x, y, z = gravity[..., 0], gravity[..., 1], gravity[..., 2]
    angles = xp.stack([xp.atan2(-y, -z), xp.atan2(x, xp.sqrt(y * y + z * z))], axis=-1)
    return xp.clip(angles, -limit_rad, limit_rad)
