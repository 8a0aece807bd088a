"""The kinds of values that describe a robot: their shape and their mirror image.

Observation terms, readings and randomised quantities declare their kind; sizes and mirror maps follow.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from footfall.robots import symmetry
from footfall.robots.symmetry import Mirror, Symmetry


class Parts(NamedTuple):
    """Number of joints, bodies and feet of a robot."""

    joints: int
    bodies: int = 0  # without the world
    feet: int = 0


class Kind(NamedTuple):
    """The shape of a value on a given robot, and its mirror image, left and right exchanged."""

    shape: Callable[[Parts], tuple[int, ...]]
    mirror: Callable[[Symmetry], Mirror]

    def size(self, parts: Parts) -> int:
        """Number of components of a value."""
        return math.prod(self.shape(parts))


def _fixed(signs: np.ndarray) -> Kind:
    """A kind whose size is the same for every robot and whose mirror image only changes signs."""
    return Kind(lambda _: signs.shape, lambda _: Mirror(np.arange(len(signs)), signs))


def _swapped(partners: np.ndarray) -> Mirror:
    return Mirror(partners, np.ones(len(partners)))


SCALAR = Kind(lambda _: (), lambda _: _swapped(np.arange(1)))
VECTOR = _fixed(symmetry.VECTOR)  # positions, velocities, forces, directions
ROTATION = _fixed(symmetry.ROTATION)  # angular velocities, torques, small rotations
QUATERNION = _fixed(np.array([1.0, -1.0, 1.0, -1.0]))  # w, x, y, z
COMMAND = _fixed(np.array([1.0, -1.0, -1.0]))  # forward, leftward, yaw
CLOCK = Kind(lambda _: (2,), lambda s: Mirror(np.arange(2), np.full(2, s.clock)))  # sine and cosine
JOINTS = Kind(lambda parts: (parts.joints,), lambda s: s.joints)  # angles, speeds, torques
JOINT_AMOUNTS = Kind(lambda parts: (parts.joints,), lambda s: _swapped(s.joints.source))  # without a sign
BODY_AMOUNTS = Kind(lambda parts: (parts.bodies,), lambda s: _swapped(s.bodies))
FOOT_AMOUNTS = Kind(lambda parts: (parts.feet,), lambda s: _swapped(s.feet))
