"""One foot during a gait, and the motion of the body over stance feet."""

import math
from typing import Any, NamedTuple, TypeVar

import numpy as np

from footfall.policies.controllers.gait import GaitTiming
from footfall.robots.kinematics import Legs

Number = TypeVar("Number", float, np.ndarray)

_STEP_M = 0.005
_UP = np.array([0.0, 0.0, 1.0])


def blend(s: Number) -> Number:
    """Quintic from 0 to 1 over s in [0, 1], with zero velocity and acceleration at both ends."""
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def lift(s: float) -> float:
    """Height during a swing: from 0 to 1 at s = 1/2 and back, at rest at both ends."""
    return 0.5 * (1.0 - math.cos(2.0 * math.pi * s))


def passing(rolling: Any, velocity: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Velocity (x, y) of the body over tips at x, y, m/s: `rolling` times (v + yaw rate x position).

    For one foot in floats, with `rolling` as nested lists (2, 2), or for arrays of feet, with `rolling`
    (feet, 2, 2).
    For few feet, floats are several times faster.
    """
    forward, leftward, yaw = velocity
    over_x, over_y = forward - yaw * y, leftward + yaw * x
    (xx, xy), (yx, yy) = rolling if isinstance(rolling, list) else np.moveaxis(rolling, (-2, -1), (0, 1))
    return xx * over_x + xy * over_y, yx * over_x + yy * over_y


class Footing(NamedTuple):
    """Positions of the tips at mid-stance, and the motion of the body over them.

    A round foot rolls: its lowest point stands still, not its centre, so the body is faster than the tip
    relative to the body. `rolling` maps the body's velocity over a foot to the tip's.
    """

    positions: np.ndarray  # (feet, 3) m, positions at mid-stance, z = 0 on the ground
    rolling: np.ndarray  # (feet, 2, 2)

    def passing(self, velocity: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Velocity (..., feet, 2) of the body over tips at (..., feet, 2), m/s.

        Args:
            velocity: (3,) forward m/s, leftward m/s, yaw rad/s of the body.
            points: (..., feet, 2) m.
        """
        return np.stack(passing(self.rolling, velocity, points[..., 0], points[..., 1]), axis=-1)


def rolling_of(legs: Legs, tips: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """`Footing.rolling` (feet, 2, 2) of limbs with tips at (feet, 3), m, below a level base.

    Args:
        legs: legs whose inverse kinematics gives the rotation of the links while the tips move with the
            ground.
        tips: positions at mid-stance, base frame.
        pose: (n,) rad, for joints outside the limbs.
    """
    step = _STEP_M * np.eye(3)[:2]
    rates = np.stack([legs.solve(tips + by) - legs.solve(tips - by) for by in step], axis=-1) / (2 * _STEP_M)
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
        self.place_x, self.place_y, *_ = position
        self._rolling = rolling
        self.reset()

    def reset(self) -> None:
        """Place the foot on the ground at mid-stance."""
        self.x, self.y, self.z = self.place_x, self.place_y, 0.0
        self.swings, self.progress = False, 0.0
        self.lands = self.x, self.y  # foothold during a swing
        self._left, self._height = (self.x, self.y, self.z), 0.0

    def lift_off(self, height_m: float) -> None:
        """Start a swing."""
        self.swings, self._height = True, height_m
        self._left = self.x, self.y, self.z

    def carried(self, velocity: list[float]) -> float:
        """Displacement from mid-stance, along the motion of a body with this velocity, m."""
        over_x, over_y = self._passing(velocity, self.x, self.y)
        along = (self.place_x - self.x) * over_x + (self.place_y - self.y) * over_y
        return along / max(math.hypot(over_x, over_y), 1e-9)

    def land(self, ground_m: float) -> None:
        """End the swing on ground at `ground_m`, limited to between the plan and the top of the swing."""
        self.z = min(max(ground_m, 0.0), max(self._height, self.z))
        self.swings, self.progress = False, 0.0

    def stand(self, velocity: list[float], dt_s: float) -> None:
        """Move with the ground under a body with this velocity (m/s, m/s, rad/s)."""
        over_x, over_y = self._passing(velocity, self.x, self.y)
        self.x -= dt_s * over_x
        self.y -= dt_s * over_y

    def fly(self, velocity: list[float], dt_s: float, progress: float, timing: GaitTiming) -> None:
        """Move from the lift-off point towards the start of the next stance, progress in [0, 1].

        Both points move with the ground. So the target is farther ahead, by the body's motion during the rest
        of the swing.
        """
        self.progress = progress
        left_x, left_y, left_z = self._left
        over_x, over_y = self._passing(velocity, left_x, left_y)
        left_x, left_y = left_x - dt_s * over_x, left_y - dt_s * over_y
        self._left = left_x, left_y, left_z
        half_s, ahead_s = 0.5 * timing.stance_s, (1.0 - progress) * timing.swing_s
        over_x, over_y = self._passing(velocity, self.place_x, self.place_y)
        x, y = self.place_x + half_s * over_x, self.place_y + half_s * over_y
        over_x, over_y = self._passing(velocity, x, y)
        share = blend(progress)
        self.lands = lands_x, lands_y = x + ahead_s * over_x, y + ahead_s * over_y
        self.x = left_x + share * (lands_x - left_x)
        self.y = left_y + share * (lands_y - left_y)
        self.z = (1.0 - share) * left_z + self._height * lift(progress)

    def lower(self, by_m: float, min_z_m: float) -> None:
        """Lower a stance foot, to a minimum height."""
        if not self.swings:
            self.z = min(self.z, max(self.z - by_m, min_z_m))

    def _passing(self, velocity: list[float], x: float, y: float) -> tuple[float, float]:
        return passing(self._rolling, velocity, x, y)
