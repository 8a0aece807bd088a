"""One foot in the course of a gait, and how the body passes over feet that stand."""

import math
from typing import Any, NamedTuple, TypeVar

import numpy as np

from footfall.policies.controllers.gait import GaitTiming
from footfall.robots.kinematics import Legs

Number = TypeVar("Number", float, np.ndarray)

_NUDGE_M = 0.005
_UP = np.array([0.0, 0.0, 1.0])


def blend(s: Number) -> Number:
    """A quintic from 0 to 1 over s in [0, 1], at rest and without acceleration at both ends."""
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def lift(s: float) -> float:
    """Height over a swing: from 0 up to 1 at s = 1/2 and back, at rest at both ends."""
    return 0.5 * (1.0 - math.cos(2.0 * math.pi * s))


def passing(rolling: Any, velocity: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Velocity (x, y) of the body over tips at x, y, m/s: `rolling` times (v + yaw rate x place).

    For one foot in floats, `rolling` as nested lists (2, 2), or for arrays of feet, `rolling` (feet, 2, 2).
    Floats are several times as fast for the few feet of a robot.
    """
    forward, leftward, yaw = velocity
    over_x, over_y = forward - yaw * y, leftward + yaw * x
    (xx, xy), (yx, yy) = rolling if isinstance(rolling, list) else np.moveaxis(rolling, (-2, -1), (0, 1))
    return xx * over_x + xy * over_y, yx * over_x + yy * over_y


class Footing(NamedTuple):
    """Where the tips of standing feet are, and how the body passes over them.

    A round foot rolls: its lowest point stands still, not its centre, so the body goes faster than the tip
    goes back. `rolling` turns the body's velocity over a foot into that of the tip.
    """

    places: np.ndarray  # (feet, 3) m, in the middle of each stance, z = 0 on the ground
    rolling: np.ndarray  # (feet, 2, 2)

    def passing(self, velocity: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Velocity (..., feet, 2) of the body over tips at (..., feet, 2), m/s.

        Args:
            velocity: (3,) forward m/s, leftward m/s, yaw rad/s of the body.
            points: (..., feet, 2) m.
        """
        return np.stack(passing(self.rolling, velocity, points[..., 0], points[..., 1]), axis=-1)


def rolling_of(legs: Legs, tips: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """`Footing.rolling` (feet, 2, 2) of limbs whose tips (feet, 3), m, base frame, stand under a level base.

    Args:
        legs: whose inverse kinematics say how the links turn while the tips go with the ground.
        tips: in the middle of each stance.
        pose: (n,) rad, of joints outside the limbs.
    """
    step = _NUDGE_M * np.eye(3)[:2]
    rates = np.stack([legs.solve(tips + by) - legs.solve(tips - by) for by in step], axis=-1) / (2 * _NUDGE_M)
    axes = legs.pose(legs.scatter(legs.solve(tips), pose)).axes
    contact = np.eye(2) + (legs.rolling_offset(axes, _UP) @ rates)[:, :2]
    return np.linalg.inv(contact)


class Foot:
    """One foot, in floats: for the few numbers of a foot they take a fraction of NumPy's time.

    Args:
        place: (x, y) m, of the tip in the middle of its stance.
        rolling: of `Footing`, (2, 2).
    """

    def __init__(self, place: list[float], rolling: list[list[float]]) -> None:
        self.place_x, self.place_y, *_ = place
        self._rolling = rolling
        self.reset()

    def reset(self) -> None:
        """On the ground, in its place."""
        self.x, self.y, self.z = self.place_x, self.place_y, 0.0
        self.swings, self.progress = False, 0.0
        self.lands = self.x, self.y  # where it lands, while it swings
        self._left, self._height = (self.x, self.y, self.z), 0.0

    def lift_off(self, height_m: float) -> None:
        """Begin a swing."""
        self.swings, self._height = True, height_m
        self._left = self.x, self.y, self.z

    def carried(self, velocity: list[float]) -> float:
        """How far a body of a velocity has carried it out of its place, along its way over the ground, m."""
        over_x, over_y = self._passing(velocity, self.x, self.y)
        along = (self.place_x - self.x) * over_x + (self.place_y - self.y) * over_y
        return along / max(math.hypot(over_x, over_y), 1e-9)

    def land(self, ground_m: float) -> None:
        """End its swing on ground of a height, no lower than planned and no higher than the swing."""
        self.z = min(max(ground_m, 0.0), max(self._height, self.z))
        self.swings, self.progress = False, 0.0

    def stand(self, velocity: list[float], dt_s: float) -> None:
        """Go with the ground under a body of a velocity (m/s, m/s, rad/s)."""
        over_x, over_y = self._passing(velocity, self.x, self.y)
        self.x -= dt_s * over_x
        self.y -= dt_s * over_y

    def fly(self, velocity: list[float], dt_s: float, progress: float, timing: GaitTiming) -> None:
        """Be on the way from the point that was left to where the next stance begins, progress in [0, 1].

        The point that was left goes with the ground, and so does the other one: hence it is farther ahead by
        what is left of the swing.
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

    def lower(self, by_m: float, least_m: float) -> None:
        """Lower a foot that stands, not below a height."""
        if not self.swings:
            self.z = min(self.z, max(self.z - by_m, least_m))

    def _passing(self, velocity: list[float], x: float, y: float) -> tuple[float, float]:
        return passing(self._rolling, velocity, x, y)
