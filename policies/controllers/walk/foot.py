"""One foot during a gait, and the motion of the body over stance feet."""

import math
from typing import Any, NamedTuple, TypeVar

import numpy as np

from footfall.policies.controllers.gait import GaitTiming
from footfall.robots.kinematics import Legs

Number = TypeVar("Number", float, np.ndarray)

_DIFFERENCE_M = 0.005  # displacement of a tip, for numerical derivatives
_UP = np.array([0.0, 0.0, 1.0])


def blend(s: Number) -> Number:
    """Quintic from 0 to 1 over s in [0, 1], with zero velocity and acceleration at both ends."""
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def lift(s: float) -> float:
    """Height during a swing: from 0 to 1 at s = 1/2 and back, at rest at both ends."""
    return 0.5 * (1.0 - math.cos(2.0 * math.pi * s))


def passing_velocity(rolling: Any, velocity: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Velocity (x, y) of the body over tips at x, y, m/s: `rolling` times (v + yaw rate x position).

    For one foot, all are floats and `rolling` is a nested list (2, 2). For arrays of feet, `rolling` has the
    shape (feet, 2, 2). For few feet, floats are several times faster.
    """
    forward, leftward, yaw = velocity
    velocity_x, velocity_y = forward - yaw * y, leftward + yaw * x
    (xx, xy), (yx, yy) = rolling if isinstance(rolling, list) else np.moveaxis(rolling, (-2, -1), (0, 1))
    return xx * velocity_x + xy * velocity_y, yx * velocity_x + yy * velocity_y


class Footing(NamedTuple):
    """Positions of the tips at mid-stance, and the motion of the body over them.

    A round foot rolls: its lowest point stands still, not its centre, the tip. The tip moves with the body,
    so the body's velocity over the tip is smaller than over the ground. `rolling` maps the body's velocity
    over the ground to its velocity over the tip.
    """

    positions: np.ndarray  # (feet, 3) m, positions at mid-stance, z = 0 on the ground
    rolling: np.ndarray  # (feet, 2, 2)

    def passing_velocity(self, velocity: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Velocity (..., feet, 2) of the body over tips at (..., feet, 2), m/s.

        Args:
            velocity: (3,) forward m/s, leftward m/s, yaw rad/s of the body.
            points: (..., feet, 2) m.
        """
        return np.stack(passing_velocity(self.rolling, velocity, points[..., 0], points[..., 1]), axis=-1)


def rolling_of(legs: Legs, tips: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """`Footing.rolling` (feet, 2, 2) of limbs with tips at (feet, 3), m, below a level base.

    Args:
        legs: legs whose inverse kinematics gives the rotation of the links while the tips move with the
            ground.
        tips: positions at mid-stance, base frame.
        pose: (n,) rad, for joints outside the limbs.
    """
    differences = _DIFFERENCE_M * np.eye(3)[:2]
    rates = np.stack([legs.solve(tips + by) - legs.solve(tips - by) for by in differences], axis=-1)
    rates /= 2 * _DIFFERENCE_M
    axes = legs.pose(legs.scatter(legs.solve(tips), pose)).axes
    contact = np.eye(2) + (legs.rolling_offset(axes, _UP) @ rates)[:, :2]
    return np.linalg.inv(contact)


class Foot:
    """One foot, in Python floats, which take a fraction of NumPy's time for so few numbers.

    Args:
        position: (x, y) m, position of the tip at mid-stance.
        rolling: matrix (2, 2) of `Footing`.
    """

    def __init__(self, position: list[float], rolling: list[list[float]]) -> None:
        self.mid_x, self.mid_y, *_ = position  # mid-stance
        self._rolling = rolling
        self.reset()

    def reset(self) -> None:
        """Place the foot on the ground at mid-stance."""
        self.x, self.y, self.z = self.mid_x, self.mid_y, 0.0
        self.swings, self.progress = False, 0.0
        self.foothold = self.x, self.y  # foothold during a swing
        self._lift_off, self._height = (self.x, self.y, self.z), 0.0

    def lift_off(self, height_m: float) -> None:
        """Start a swing."""
        self.swings, self._height = True, height_m
        self._lift_off = self.x, self.y, self.z

    def travel(self, velocity: list[float]) -> float:
        """Displacement from mid-stance, along the motion of a body with this velocity, m."""
        velocity_x, velocity_y = self._passing_velocity(velocity, self.x, self.y)
        along = (self.mid_x - self.x) * velocity_x + (self.mid_y - self.y) * velocity_y
        return along / max(math.hypot(velocity_x, velocity_y), 1e-9)

    def land(self, ground_m: float) -> None:
        """End the swing on ground at `ground_m`, clamped between the planned height and the swing's top."""
        self.z = min(max(ground_m, 0.0), max(self._height, self.z))
        self.swings, self.progress = False, 0.0

    def stand(self, velocity: list[float], dt_s: float) -> None:
        """Move with the ground under a body with this velocity (m/s, m/s, rad/s)."""
        velocity_x, velocity_y = self._passing_velocity(velocity, self.x, self.y)
        self.x -= dt_s * velocity_x
        self.y -= dt_s * velocity_y

    def fly(self, velocity: list[float], dt_s: float, progress: float, timing: GaitTiming) -> None:
        """Move from the lift-off point towards the start of the next stance, progress in [0, 1].

        Both points move with the ground. So the target is farther ahead, by the body's motion during the rest
        of the swing.
        """
        self.progress = progress
        start_x, start_y, start_z = self._lift_off
        velocity_x, velocity_y = self._passing_velocity(velocity, start_x, start_y)
        start_x, start_y = start_x - dt_s * velocity_x, start_y - dt_s * velocity_y
        self._lift_off = start_x, start_y, start_z
        half_s, remaining_s = 0.5 * timing.stance_s, (1.0 - progress) * timing.swing_s
        velocity_x, velocity_y = self._passing_velocity(velocity, self.mid_x, self.mid_y)
        x, y = self.mid_x + half_s * velocity_x, self.mid_y + half_s * velocity_y
        velocity_x, velocity_y = self._passing_velocity(velocity, x, y)
        share = blend(progress)
        self.foothold = foothold_x, foothold_y = x + remaining_s * velocity_x, y + remaining_s * velocity_y
        self.x = start_x + share * (foothold_x - start_x)
        self.y = start_y + share * (foothold_y - start_y)
        self.z = (1.0 - share) * start_z + self._height * lift(progress)

    def lower(self, by_m: float, min_z_m: float) -> None:
        """Lower a stance foot, to a minimum height."""
        if not self.swings:
            self.z = min(self.z, max(self.z - by_m, min_z_m))

    def _passing_velocity(self, velocity: list[float], x: float, y: float) -> tuple[float, float]:
        return passing_velocity(self._rolling, velocity, x, y)
