"""Where and when the next foot lands: step place and time from the capture point.

With the centre of pressure at rest at p, the capture point x moves along x(t) = p + (x - p) exp(w t). The
foot lands at u after a time T, and the capture point is then b away from it: u + b = p + (x - p) k, with
k = exp(w T). A gait of period T has its own u, k and b; the next step comes as near to these as it can, b
first, for it decides all later steps. (Khadiv et al. 2020, "Walking control based on step timing
adaptation".) Horizontal vectors (2,) in the heading frame, m, from the middle of the standing foot.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import daqp
import numpy as np

from footfall.common.config import require_ordered, require_positive

Range = tuple[float, float]


@dataclass(frozen=True)
class StepLimits:
    """Where a foot can land from the other one, and when."""

    ahead_m: Range
    apart_m: Range  # to the swinging foot's own side
    time_s: Range  # since the step before
    least_swing_s: float  # a foot in the air cannot land sooner than this from now
    speed_m_s: float  # nor sooner than its way takes at this mean speed

    def __post_init__(self) -> None:
        require_ordered(self, "ahead_m", "apart_m", "time_s")
        require_positive(self, "least_swing_s", "speed_m_s")


@dataclass(frozen=True)
class StepWeights:
    """Cost of squared differences from the nominal step."""

    place: float  # per m^2
    time: float  # of exp(w T)
    offset: float  # of the capture point from the foot, per m^2

    def __post_init__(self) -> None:
        require_positive(self, "place", "time", "offset")


class NominalStep(NamedTuple):
    """A step of a steady gait."""

    place: np.ndarray  # (2,) where the foot lands
    time_s: float
    offset: np.ndarray  # (2,) of the capture point from it
    lag: float  # what double support adds to the offset, per length of the step (see `nominal_step`)


class NextStep(NamedTuple):
    """What was decided."""

    place: np.ndarray  # (2,)
    remaining_s: float  # until the foot lands


def nominal_step(
    velocity: np.ndarray, side: float, apart_m: float, time_s: float, double_support_s: float, rate: float
) -> NominalStep:
    """The step of a gait at a steady velocity.

    While both feet bear, at the beginning of a step, the centre of pressure moves evenly from the old foot
    to the new one, by the last step's L. For the capture point at the end of the step that is as if it had
    begun by k L nearer to the new foot, k = 1 - (1 - exp(-w d)) / (w d): x(T) = exp(w T) (b + k L). A steady
    gait has the same L and b ahead in each step, and sideways the opposite ones.

    Args:
        velocity: (2,) m/s, heading frame.
        side: +1.0 where the left foot swings, -1.0 where the right one does.
        apart_m: between the feet, sideways.
        time_s: of each step.
        double_support_s: d, in which both bear.
        rate: w of the pendulum, 1/s.
    """
    growth = math.exp(rate * time_s)
    both = rate * double_support_s
    lag = 1.0 - (1.0 - math.exp(-both)) / both
    travel, across = velocity * time_s, np.array([0.0, side * apart_m])
    offset = travel * (1.0 - growth * lag) / (growth - 1.0) - across * (1.0 + growth * lag) / (growth + 1.0)
    return NominalStep(travel + across, time_s, offset, lag)


def next_step(
    capture: np.ndarray,
    pressure: np.ndarray,
    elapsed_s: float,
    way_m: float,
    side: float,
    rate: float,
    nominal: NominalStep,
    limits: StepLimits,
    weights: StepWeights,
) -> NextStep:
    """Place and time of the next touch-down: a least-squares problem of three bounded unknowns.

    Args:
        capture: (2,) the capture point now.
        pressure: (2,) the centre of pressure until the foot lands.
        elapsed_s: since the step before.
        way_m: that the foot still has before it.
        side: +1.0 where the left foot swings, -1.0 where the right one does.
        rate: w of the pendulum, 1/s.
        nominal: the step to come near to.
        limits: of place and time.
        weights: of the differences.
    """
    growth = math.exp(rate * (nominal.time_s - elapsed_s))
    soonest = max(limits.time_s[0] - elapsed_s, limits.least_swing_s, way_m / limits.speed_m_s)
    latest = max(limits.time_s[1] - elapsed_s, soonest)
    apart = sorted((side * limits.apart_m[0], side * limits.apart_m[1]))
    # In (place, growth): the offset is pressure + (capture - pressure) growth - place. What counts for the
    # steps after it is offset + lag place: a long step needs less of an offset.
    away, held = capture - pressure, 1.0 - nominal.lag
    missed = np.array([[-held, 0.0, away[0]], [0.0, -held, away[1]]])
    aim = nominal.offset + nominal.lag * nominal.place - pressure
    goal = np.array([nominal.place[0], nominal.place[1], growth])
    diagonal = np.array([weights.place, weights.place, weights.time])
    hessian = weights.offset * (missed.T @ missed)
    hessian.flat[::4] += diagonal
    solution, _, status, _ = daqp.solve(
        hessian,
        -(diagonal * goal + weights.offset * (aim @ missed)),
        np.zeros((0, 3)),
        np.array([limits.ahead_m[1], apart[1], math.exp(rate * latest)]),
        np.array([limits.ahead_m[0], apart[0], math.exp(rate * soonest)]),
    )
    if status <= 0 or not np.all(np.isfinite(solution)):
        return NextStep(nominal.place, max(nominal.time_s - elapsed_s, soonest))
    return NextStep(np.array(solution[:2]), math.log(solution[2]) / rate)


def capture_after(
    capture: np.ndarray, pressure: np.ndarray, pressure_rate: np.ndarray, time_s: float, rate: float
) -> np.ndarray:
    """The capture point after a time in which the centre of pressure moves evenly, (2,) m.

    The solution of dx/dt = w (x - p - r t).
    """
    lead = pressure_rate / rate
    return pressure + pressure_rate * time_s + lead + (capture - pressure - lead) * math.exp(rate * time_s)
