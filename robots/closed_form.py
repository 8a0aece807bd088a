"""Closed-form inverse kinematics of a limb of three hinges, the last two parallel.

Most quadrupeds have such legs (abduction, hip, knee), and so do hexapods (coxa, femur, tibia). Seen from the
first link, the limb is a two-link arm in the plane across the parallel axes, so that a complex number
describes the tip's position in that plane:

    z = exp(i q2) (upper + exp(i q3) lower)

and the first hinge carries the plane around its axis.
"""

import cmath
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from footfall.common.rotations import skew
from footfall.robots.limb import Limb

_PARALLEL = 1e-6  # largest sine of the angle between two axes that count as parallel
_SHORT_M = 1e-3  # shortest link


class ClosedForm(NamedTuple):
    """Constants of one limb's inverse kinematics, and the choice among its solutions.

    The limb's plane turns with the first hinge: a vector's part in it is the sum of a constant, a multiple of
    the first angle's cosine and a multiple of its sine.
    """

    anchor: list[float]  # (3,) m, point on the first hinge
    along: list[float]  # (3,) component of the parallel axes along the first axis
    across: list[complex]  # (3,) component across it; the imaginary part is a quarter turn ahead
    constant: list[complex]  # (3,) a vector's part in the plane: the constant
    cosine: list[complex]  # (3,) the multiple of the cosine
    sine: list[complex]  # (3,) the multiple of the sine
    offset: float  # m, of the tip from the first hinge along the parallel axes
    side: float  # +1 or -1: selects one of the first hinge's two solutions
    origin: complex  # m, the second hinge in the limb's plane
    upper: complex  # m, link from the second hinge to the third
    lower: complex  # m, link from the third hinge to the tip
    bend: float  # +1 or -1: selects one of the knee's two solutions
    square_sum: float  # m^2, of the two links' lengths
    twice_product: float  # m^2, of the two links' lengths
    knee_offset: float  # rad, between the links at zero knee angle
    middle: list[float]  # (3,) rad, middle of each joint's range
    half: list[float]  # (3,) rad, half of each joint's range

    def angles(self, tip: Sequence[float]) -> tuple[float, float, float]:
        """The three angles, rad, for a tip position (3,) in the base frame, m.

        The angles are always within the limits. For a position out of reach, the limb points at it, stretched
        or folded.
        """
        # Called for each limb in each tick: products are written out, since function calls double their time.
        (x, y, z), (x0, y0, z0) = tip, self.anchor
        x, y, z = x - x0, y - y0, z - z0
        # The first hinge must bring the reach's part along the parallel axes to its fixed value (Paden and
        # Kahan's fourth subproblem): across cos(q1) + turned sin(q1) = offset - along.
        a, b, c = self.across
        across = x * a + y * b + z * c
        u, v, w = self.along
        along = x * u + y * v + z * w
        turn = self.side * _arccos((self.offset - along) / max(abs(across), 1e-9))
        first = _within(cmath.phase(across) + turn, self.middle[0], self.half[0])
        # Law of cosines for the knee, then the hip turns the two-link arm towards the tip.
        a, b, c = self.constant
        position = x * a + y * b + z * c - self.origin
        a, b, c = self.cosine
        d, e, f = self.sine
        position += math.cos(first) * (x * a + y * b + z * c) + math.sin(first) * (x * d + y * e + z * f)
        square = position.real * position.real + position.imag * position.imag
        knee = self.bend * _arccos((square - self.square_sum) / self.twice_product)
        third = _within(knee - self.knee_offset, self.middle[2], self.half[2])
        arm = self.upper + cmath.rect(1.0, third) * self.lower
        second = _within(cmath.phase(position * arm.conjugate()), self.middle[1], self.half[1])
        return first, second, third


def closed_form(limb: Limb, default_tip: np.ndarray) -> ClosedForm | None:
    """The closed form of a limb; None for a limb with other axes.

    The knee and the first hinge turn to the same side as in the default pose.

    Args:
        limb: its geometry.
        default_tip: (3,) m, position of its tip in the default pose.
    """
    if len(limb.axis) != 3:
        return None
    first, normal, third = limb.axis
    not_parallel = np.linalg.norm(np.cross(normal, third)) > _PARALLEL or normal @ third < 0
    if not_parallel or np.linalg.norm(np.cross(first, normal)) < _PARALLEL:
        return None
    upper_link, lower_link = limb.anchor[2] - limb.anchor[1], limb.tip - limb.anchor[2]
    flat = upper_link - (upper_link @ normal) * normal
    if np.linalg.norm(flat) < _SHORT_M:
        return None
    x = flat / np.linalg.norm(flat)
    plane = x + 1j * np.cross(normal, x)  # a vector's product with it is its position in the plane
    upper, lower = complex(upper_link @ plane), complex(lower_link @ plane)
    if abs(lower) < _SHORT_M:
        return None
    hip = limb.anchor[1] - limb.anchor[0] + ((upper_link + lower_link) @ normal) * normal
    along, across, turned = _split_rotation(first)
    knee_offset = cmath.phase(lower / upper)
    right = ClosedForm(
        anchor=limb.anchor[0].tolist(),
        along=(along @ normal).tolist(),
        across=(across @ normal + 1j * (turned @ normal)).tolist(),
        constant=(along @ plane).tolist(),
        cosine=(across @ plane).tolist(),
        sine=(turned @ plane).tolist(),
        offset=float(hip @ normal),
        side=1.0,
        origin=complex(hip @ plane),
        upper=upper,
        lower=lower,
        bend=-1.0 if math.sin(limb.default[2] + knee_offset) < 0 else 1.0,
        square_sum=abs(upper) ** 2 + abs(lower) ** 2,
        twice_product=2 * abs(upper) * abs(lower),
        knee_offset=knee_offset,
        middle=((limb.upper + limb.lower) / 2).tolist(),
        half=((limb.upper - limb.lower) / 2).tolist(),
    )
    left = right._replace(side=-1.0)
    position = default_tip.tolist()
    return min((right, left), key=lambda solution: np.abs(solution.angles(position) - limb.default).max())


def _arccos(cosine: float) -> float:
    """Arc cosine of a number clamped to [-1, 1]; NaN stays NaN."""
    return math.acos(1.0 if cosine > 1.0 else -1.0 if cosine < -1.0 else cosine)


def _within(angle: float, middle: float, half: float) -> float:
    """The turn of an angle that is nearest to the middle of a range, moved into the range."""
    offset = (angle - middle + math.pi) % (2 * math.pi) - math.pi
    return middle + (half if offset > half else -half if offset < -half else offset)


def _split_rotation(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rodrigues' rotation about an axis as along + cos(q) across + sin(q) turned, each (3, 3)."""
    along = np.outer(axis, axis)
    return along, np.eye(3) - along, skew(axis)
