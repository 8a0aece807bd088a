"""Gait clock, contact schedule and swing curve."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from footfall.common.config import require_not_negative, require_positive
from footfall.policies.gaits import find_gait, require_duty
from footfall.robots.description import Robot

_START_PHASES = np.arange(48) / 48  # phases from which `change_gait` chooses


@dataclass(frozen=True)
class GaitConfig:
    """Name and timing of a gait."""

    name: str  # name in policies/gaits.yaml
    period_s: float
    duty: float | None = None  # replaces the named gait's duty factor
    lead_s: float = 0.0  # time after the start in which all feet stay down, while the weight shifts

    def __post_init__(self) -> None:
        require_positive(self, "period_s")
        require_duty(self.duty)
        require_not_negative(self, "lead_s")

    def clock(self, robot: Robot) -> "StepClock":
        """Clock of this gait on a robot.

        Raises:
            UserError: the robot has no such gait.
        """
        duty, phase = find_gait(self.name, robot)
        return StepClock(GaitTiming(self.period_s, self.duty or duty), phase, self.lead_s)


@dataclass(frozen=True)
class GaitTiming:
    """A periodic gait. Each foot is in stance for the first `duty` of its cycle and in swing for the rest."""

    period_s: float
    duty: float

    def __post_init__(self) -> None:
        require_positive(self, "period_s")
        require_duty(self.duty)

    @property
    def stance_s(self) -> float:
        return self.period_s * self.duty

    @property
    def swing_s(self) -> float:
        return self.period_s * (1 - self.duty)


def leg_phases(clock: np.ndarray | float, offsets: np.ndarray) -> np.ndarray:
    """Phase of each leg in its own cycle, in [0, 1).

    Args:
        clock: phase of the gait in cycles, a number or shape (..., 1).
        offsets: (legs,) phase offset of each leg.
    """
    return (clock + offsets) % 1.0


def in_stance(phases: np.ndarray, duty: float) -> np.ndarray:
    """Legs in stance, boolean, shape of `phases`."""
    return phases < duty


def swing_progress(phases: np.ndarray, duty: float) -> np.ndarray:
    """Progress of each leg's swing, (legs,), from 0 at lift-off to 1 at touch-down; 0 in stance."""
    return np.array([max(phase - duty, 0.0) / (1.0 - duty) for phase in phases.tolist()])


def contact_trust(phases: np.ndarray, duty: float, edge: float) -> np.ndarray:
    """Planned contact in [0, 1]: 1 in mid-stance, falling to 0 at both ends, where the plan is uncertain.

    Args:
        phases: (legs,).
        duty: share of the cycle in stance.
        edge: share of the stance over which trust rises and falls (as in Bledt et al. 2018).
    """
    # Faster than NumPy for so few legs.
    return np.array([trust_at(phase, duty, edge) for phase in phases.tolist()])


def trust_at(phase: float, duty: float, edge: float) -> float:
    """`contact_trust` for one leg."""
    share = phase / duty
    return min(max(min(share, 1.0 - share) / edge, 0.0), 1.0)


class Curve(NamedTuple):
    """A value over the normalised time s, with its derivatives with respect to s."""

    value: float
    slope: float  # first derivative
    bend: float  # second derivative


class SwingCurve(NamedTuple):
    """Motion of a foot from lift-off to touch-down. Both parts are at rest at both ends."""

    along: Curve  # a cycloid from 0 to 1
    height: Curve  # rises from 0 to 1 at s = 1/2, falls back to 0


def swing_curve(s: float) -> SwingCurve:
    """Both parts of a swing at a normalised time s in [0, 1]."""
    angle = 2 * math.pi * s
    sin, cos = math.sin(angle), math.cos(angle)
    rise = 1 - cos
    return SwingCurve(
        Curve(s - sin / (2 * math.pi), rise, 2 * math.pi * sin),
        Curve(rise / 2, math.pi * sin, 2 * math.pi**2 * cos),
    )


class StepClock:
    """Phase of the gait. It runs while the robot walks and stops only when all feet are down.

    Args:
        timing: timing of the gait.
        offsets: (legs,) phase offset of each leg.
        lead_s: time from the command to walk until the phase runs.
    """

    def __init__(self, timing: GaitTiming, offsets: np.ndarray, lead_s: float = 0.0) -> None:
        self.timing = timing
        self.offsets = offsets
        self._lead_s = lead_s
        self.reset()

    def reset(self) -> None:
        """Stand at the beginning of a cycle."""
        self.phase = 0.0
        self.walking = False
        self._waited_s = 0.0  # since the command to walk, while all feet stay down
        self._cached = self.phase, leg_phases(self.phase, self.offsets)

    def change_gait(self, timing: GaitTiming, offsets: np.ndarray) -> None:
        """Change the gait while all feet stand. The clock starts where the swings have progressed least."""
        self.timing, self.offsets = timing, offsets
        phases = leg_phases(_START_PHASES[:, None], offsets)
        progress = np.maximum(phases - timing.duty, 0.0).sum(axis=1)
        self.phase = float(_START_PHASES[progress.argmin()])
        self._cached = self.phase, leg_phases(self.phase, offsets)

    def advance(self, dt_s: float, walk: bool) -> None:
        """Advance by `dt_s`. After the command to stop, the clock finishes the swings that have begun."""
        if not self.walking:
            self._waited_s = self._waited_s + dt_s if walk else 0.0
            self.walking = self._waited_s > self._lead_s
        if not self.walking:
            return
        previous = self.phase
        self.phase = (previous + dt_s / self.timing.period_s) % 1.0
        if not walk and not np.any(self._swinging(previous) & self._swinging(self.phase)):
            # Every swing has ended: the next ones wait at this phase.
            self.walking, self._waited_s = False, 0.0

    def phases(self) -> np.ndarray:
        """Phase of each leg, (legs,), read-only; cached until the clock advances."""
        if self._cached[0] != self.phase:
            self._cached = self.phase, leg_phases(self.phase, self.offsets)
        return self._cached[1]

    def stance(self) -> np.ndarray:
        """Legs in stance now, boolean (legs,)."""
        if not self.walking:
            return np.ones(len(self.offsets), dtype=bool)
        return in_stance(self.phases(), self.timing.duty)

    def planned_stance(self, ahead_s: np.ndarray) -> np.ndarray:
        """Legs in stance at future times, boolean (times, legs), for times from now (times,) in s."""
        if not self.walking and not self._waited_s:
            return np.ones((len(ahead_s), len(self.offsets)), dtype=bool)
        running_s = ahead_s[:, None] - (0.0 if self.walking else self._lead_s - self._waited_s)
        clock = self.phase + running_s / self.timing.period_s
        return in_stance(leg_phases(clock, self.offsets), self.timing.duty) | (running_s < 0.0)

    def swing(self) -> np.ndarray:
        """Progress of each leg's swing in [0, 1], (legs,); 0 for legs in stance."""
        if not self.walking:
            return np.zeros(len(self.offsets))
        return swing_progress(self.phases(), self.timing.duty)

    def _swinging(self, clock: float) -> np.ndarray:
        return ~in_stance(leg_phases(clock, self.offsets), self.timing.duty)
