"""Slope of the ground, from the stance feet, and the robot relative to that slope.

Controllers are written for level ground. On a slope they use a frame whose z axis is the ground's normal:
attitude, height, footholds and friction cones refer to it, and only gravity is tilted. On ground that counts
as level this frame is the world, and nothing changes.
"""

import math
from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_not_negative, require_positive
from footfall.common.constants import GRAVITY_M_S2
from footfall.common.rotations import heading_matrix, multiply, rotation_matrix
from footfall.policies.policy import PolicyInput

_RIDGE_M2 = 0.05**2  # regularisation: feet closer together than this give little information on a slope
_UP = np.array([0.0, 0.0, 1.0])
_HEIGHT_FILTER_S = 0.02  # time constant of the feet's middle, equal to that of the estimated height


@dataclass(frozen=True)
class SlopeConfig:
    """Settings of the slope estimate. A gradient is rise over run."""

    filter_s: float  # time constant of the estimate
    deadband: float  # gradient below which ground counts as level; also subtracted from larger gradients
    max_gradient: float  # a larger gradient is clamped to this one

    def __post_init__(self) -> None:
        require_positive(self, "filter_s", "max_gradient")
        require_not_negative(self, "deadband")


def corrected_gradient(
    gradient: np.ndarray, feet: np.ndarray, contact: np.ndarray, share: float
) -> np.ndarray:
    """A gradient (2,), rise over run along x and y, moved towards the plane through the stance feet.

    Least squares around the current gradient: two feet correct it only along the line between them, so the
    alternating pairs of a trot give both directions.

    Args:
        gradient: (2,) previous estimate.
        feet: (feet, 3) m, z up.
        contact: (feet,) trust in each foot's contact, in [0, 1].
        share: share of the correction that is applied, in [0, 1].
    """
    middle = standing_middle(feet, contact)
    if middle is None:
        return gradient
    middle_x, middle_y, middle_z = middle
    gradient_x, gradient_y = gradient.tolist()
    total = xx = xy = yy = x = y = 0.0
    for weight, foot in zip(contact.tolist(), feet.tolist(), strict=True):
        arm_x, arm_y = foot[0] - middle_x, foot[1] - middle_y
        error = foot[2] - middle_z - arm_x * gradient_x - arm_y * gradient_y
        total += weight
        weighted_x, weighted_y = weight * arm_x, weight * arm_y
        xx, xy, yy = (
            xx + weighted_x * arm_x,
            xy + weighted_x * arm_y,
            yy + weighted_y * arm_y,
        )
        x, y = x + weighted_x * error, y + weighted_y * error
    xx, yy = xx + total * _RIDGE_M2, yy + total * _RIDGE_M2
    share /= xx * yy - xy * xy
    return np.array([gradient_x + share * (yy * x - xy * y), gradient_y + share * (xx * y - xy * x)])


def standing_middle(feet: np.ndarray, contact: np.ndarray) -> tuple[float, float, float] | None:
    """Middle (3,) of feet (feet, 3) m, weighted by the trust in their contact; None if all weights are 0.
    It computes in Python floats: for a robot's few feet they take a fraction of NumPy's time.
    """
    total = x = y = z = 0.0
    for weight, foot in zip(contact.tolist(), feet.tolist(), strict=True):
        total += weight
        x, y, z = x + weight * foot[0], y + weight * foot[1], z + weight * foot[2]
    return None if total <= 0.0 else (x / total, y / total, z / total)


def applied_gradient(gradient: np.ndarray, deadband: float, limit: float) -> np.ndarray:
    """The gradient (2,), reduced by `deadband`, clamped to `limit`; exactly zero on nearly level ground."""
    steepness = math.hypot(*gradient.tolist())
    if steepness <= deadband:
        return np.zeros(2)
    return gradient * (min(steepness - deadband, limit) / steepness)


def plane_quaternion(gradient: np.ndarray) -> np.ndarray:
    """Smallest rotation (4,), w x y z, from the world's axes to those of a plane, whose z is its normal."""
    x, y = gradient.tolist()
    cosine = 1.0 / math.sqrt(1.0 + x * x + y * y)
    turn = np.array([1.0 + cosine, y * cosine, -x * cosine, 0.0])
    return turn / math.sqrt(float(turn.dot(turn)))


def downhill(up: np.ndarray, height_m: float) -> complex:
    """Vector along sloping ground, m, x + i y: from the point below a body along the ground's normal to the
    point vertically below it. Feet around the second point share the weight equally.

    Args:
        up: (3,) vertical unit vector, in axes along a heading on the ground.
        height_m: distance of the body from the ground along the normal.
    """
    x, y, z = up.tolist()
    return -complex(x, y) * (height_m / z)


class Slope:
    """Estimates the ground's gradient while the robot walks. Without settings the ground is level.

    Attributes:
        gradient: (2,) rise over run along the world's x and y, zero on ground that counts as level.
        level: whether the ground counts as level.
        axes: (3, 3) rotation from the ground's axes to the world.
        gravity: (3,) m/s^2, in the ground's axes.
    """

    def __init__(self, config: SlopeConfig | None) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Start on level ground."""
        self._measured = np.zeros(2)
        self._middle: complex | None = None  # m, x + i y, world: stance feet relative to the base
        self._set_gradient(np.zeros(2))

    def follow(self, inputs: PolicyInput, feet: np.ndarray, contact: np.ndarray, dt_s: float) -> PolicyInput:
        """Inputs relative to the ground: attitude relative to its normal, height along it.

        Args:
            inputs: inputs as measured.
            feet: (feet, 3) m, base frame.
            contact: (feet,) trust in each foot's contact, in [0, 1].
            dt_s: time since the last call.
        """
        config = self._config
        if config is None:
            return inputs
        feet = feet.dot(rotation_matrix(inputs.sensed.quaternion).T)
        self._measured = corrected_gradient(self._measured, feet, contact, min(1.0, dt_s / config.filter_s))
        self._follow_middle(feet, contact, dt_s)
        gradient = applied_gradient(self._measured, config.deadband, config.max_gradient)
        if gradient.tolist() != self.gradient.tolist():  # on level ground it stays the same for minutes
            self._set_gradient(gradient)
        if self.level or self._middle is None:
            return inputs
        x, y = gradient.tolist()
        rise = x * self._middle.real + y * self._middle.imag
        height = (inputs.base_height + rise) * float(self.axes[2, 2])
        sensed = inputs.sensed._replace(quaternion=multiply(self._to_ground, inputs.sensed.quaternion))
        return inputs._replace(sensed=sensed, base_height=height)

    def up(self, yaw: float) -> np.ndarray:
        """Vertical unit vector (3,) in axes along a heading on the ground; read-only."""
        if self.level:
            return _UP
        return -self.gravity.dot(heading_matrix(yaw)) / GRAVITY_M_S2

    def downhill(self, yaw: float, height_m: float) -> complex:
        """See the function `downhill`; `yaw` is the heading."""
        return downhill(self.up(yaw), height_m)

    def _follow_middle(self, feet: np.ndarray, contact: np.ndarray, dt_s: float) -> None:
        newest = standing_middle(feet, contact)
        if newest is not None:
            middle = complex(*newest[:2])
            previous = middle if self._middle is None else self._middle
            self._middle = previous + dt_s / (_HEIGHT_FILTER_S + dt_s) * (middle - previous)

    def _set_gradient(self, gradient: np.ndarray) -> None:
        self.gradient, self.level = gradient, not gradient.any()
        turn = plane_quaternion(gradient)
        self._to_ground = turn * [1.0, -1.0, -1.0, -1.0]
        self.axes = rotation_matrix(turn)
        self.gravity = -GRAVITY_M_S2 * self.axes[2]
