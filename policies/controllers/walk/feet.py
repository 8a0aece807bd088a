"""Where the feet are in the course of a gait, and when they lift off and touch down."""

import math

import numpy as np

from footfall.common.rotations import cross
from footfall.policies.controllers.gait import GaitTiming, leg_phases


def blend(s: np.ndarray) -> np.ndarray:
    """A quintic from 0 to 1 over s in [0, 1], at rest and without acceleration at both ends."""
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def lift(s: np.ndarray) -> np.ndarray:
    """Height over a swing: from 0 up to 1 at s = 1/2 and back, at rest at both ends."""
    return 0.5 * (1.0 - np.cos(2.0 * math.pi * s))


class FootCycle:
    """Feet that stand go with the ground, feet that swing fly over it to where their next stance begins.

    Places are those of the tips in the level body's frame, z = 0 on the ground. A swing leads from the point
    that was left to the one that is aimed at, and both go with the ground: so place and velocity are
    continuous at lift-off and at touch-down, also while the velocity changes.

    Args:
        places: (feet, 3) m, in the middle of each stance, z = 0.
        timing: of the gait.
        offsets: (feet,) place of each foot in the cycle.
    """

    def __init__(self, places: np.ndarray, timing: GaitTiming, offsets: np.ndarray) -> None:
        self._places = places
        self.begin(timing, offsets)
        self.reset()

    def reset(self) -> None:
        """All feet in their places on the ground, the clock at 0."""
        self.clock = 0.0
        self.feet = self._places.copy()
        self.swings = np.zeros(len(self.feet), dtype=bool)
        self.progress = np.zeros(len(self.feet))
        self._left = self.feet.copy()
        self._height = np.zeros(len(self.feet))

    def begin(self, timing: GaitTiming, offsets: np.ndarray) -> None:
        """Another gait, for feet that all stand. One that would be in the air waits for its next swing."""
        self.timing, self.offsets = timing, offsets

    def phases(self) -> np.ndarray:
        """Place of each foot in its cycle, (feet,), in [0, 1)."""
        return leg_phases(self.clock, self.offsets)

    def advance(self, velocity: np.ndarray, dt_s: float, step_height_m: float, lift_off: bool) -> None:
        """Let time pass.

        Args:
            velocity: (3,) forward m/s, leftward m/s, yaw rad/s of the body.
            dt_s: how long.
            step_height_m: of swings that begin now.
            lift_off: whether feet may lift off; those in the air land in any case.
        """
        before = self.phases()
        self.clock = (self.clock + dt_s / self.timing.period_s) % 1.0
        now, duty = self.phases(), self.timing.duty
        starts = (before < duty) & (now >= duty) & ~self.swings & lift_off
        ends = self.swings & (now < duty)
        self._left[starts], self._height[starts] = self.feet[starts], step_height_m
        self.swings = (self.swings | starts) & ~ends

        self.feet[:, :2] -= _passing(velocity, self.feet)[:, :2] * dt_s
        self._left[:, :2] -= _passing(velocity, self._left)[:, :2] * dt_s
        self.progress = np.where(self.swings, (now - duty) / (1.0 - duty), 0.0)
        to_touch_down_s = (1.0 - self.progress) * self.timing.swing_s
        begin = self._places + _passing(velocity, self._places) * (0.5 * self.timing.stance_s)
        aim = begin + _passing(velocity, begin) * to_touch_down_s[:, None]
        share = blend(self.progress)[:, None]
        flown = self._left + share * (aim - self._left)
        flown[:, 2] = (1.0 - share[:, 0]) * self._left[:, 2] + self._height * lift(self.progress)
        self.feet[self.swings] = flown[self.swings]
        self.feet[ends, 2] = 0.0

    def touch_down(self, feet: np.ndarray) -> None:
        """Feet (feet,) boolean that have met the ground before their time stand where they are."""
        self.swings &= ~feet

    def lower(self, feet: np.ndarray, by_m: float, least_m: float) -> None:
        """Lower standing feet (feet,) boolean, not below a height."""
        lowered = np.maximum(self.feet[:, 2] - by_m, least_m)
        self.feet[:, 2] = np.where(feet & ~self.swings, np.minimum(self.feet[:, 2], lowered), self.feet[:, 2])


def _passing(velocity: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Velocity (feet, 3) of the body over points of the ground, m/s."""
    turning = cross(np.array([0.0, 0.0, velocity[2]]), places)
    return turning + np.array([velocity[0], velocity[1], 0.0])


def steady_cycle(
    places: np.ndarray, timing: GaitTiming, velocity: np.ndarray, step_height_m: float, progress: np.ndarray
) -> np.ndarray:
    """Feet (k, feet, 3) of a steady walk at k points of each foot's own swing, progress in [0, 1]."""
    passing = _passing(velocity, places)
    half = 0.5 * timing.stance_s * passing
    share, along = blend(progress)[:, None, None], progress[:, None, None]
    whole = 2.0 * half + passing * timing.swing_s
    feet = places - half + share * whole - along * passing * timing.swing_s
    feet[:, :, 2] = step_height_m * lift(progress)[:, None]
    return feet


def stances(
    places: np.ndarray, timing: GaitTiming, offsets: np.ndarray, velocity: np.ndarray, clocks: np.ndarray
) -> list[list[tuple[float, float]]]:
    """Points on which a steady walk stands at each of k times of the gait's clock."""
    passing = _passing(velocity, places)
    found = []
    for clock in clocks.tolist():
        phases = leg_phases(clock, offsets)
        stands = phases < timing.duty
        feet = places + (0.5 - phases / timing.duty)[:, None] * timing.stance_s * passing
        found.append([(x, y) for x, y in feet[stands, :2].tolist()])
    return found
