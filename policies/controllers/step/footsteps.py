"""Position and time of the next touch-down, from the capture point.

With a constant centre of pressure p, the capture point x moves along x(t) = p + (x - p) exp(w t). The foot
lands at u after a time T. The capture point's offset from it is then b: u + b = p + (x - p) k, with k = exp(w
T). A gait of period T has nominal u, k and b. The next step minimises the weighted deviations; b has the
largest weight, because it decides all later steps. (Khadiv et al. 2020, "Walking control based on step timing
adaptation".) Horizontal vectors (2,) are in the heading frame, m, relative to the middle of the stance foot.
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
    """Limits of a step's position relative to the other foot, and of its time."""

    ahead_m: Range
    apart_m: Range  # towards the swing foot's own side
    time_s: Range  # since the previous touch-down
    min_swing_s: float  # shortest time from now to a touch-down
    speed_m_s: float  # largest mean speed of the foot until touch-down

    def __post_init__(self) -> None:
        require_ordered(self, "ahead_m", "apart_m", "time_s")
        require_positive(self, "min_swing_s", "speed_m_s")


@dataclass(frozen=True)
class StepWeights:
    """Cost of squared deviations from the nominal step."""

    place: float  # per m^2
    time: float  # per unit of exp(w T)
    offset: float  # offset of the capture point from the foot, per m^2

    def __post_init__(self) -> None:
        require_positive(self, "place", "time", "offset")


class NominalStep(NamedTuple):
    """A step of a steady gait."""

    foothold: np.ndarray  # (2,) position of touch-down
    time_s: float
    offset: np.ndarray  # (2,) offset of the capture point from the touch-down
    lag: float  # c: increase of the offset due to double support, per length of the step (see `nominal_step`)


class NextStep(NamedTuple):
    """Position and time of the next touch-down."""

    foothold: np.ndarray  # (2,)
    remaining_s: float  # until touch-down


def nominal_step(
    velocity: np.ndarray, side: float, apart_m: float, time_s: float, double_support_s: float, rate: float
) -> NominalStep:
    """Step of a gait at a steady velocity.

    In double support, at the start of a step, the centre of pressure moves uniformly from the old foot to the
    new one, by the previous step's L. At the end of the step the capture point is as if it had started c L
    closer to the new foot, c = 1 - (1 - exp(-w d)) / (w d): x(T) = exp(w T) (b + c L). In a steady gait, the
    forward parts of L and b are the same in each step; the lateral parts change their sign.

    Args:
        velocity: (2,) m/s, heading frame.
        side: +1.0 if the left foot swings, -1.0 if the right foot swings.
        apart_m: lateral distance of the feet.
        time_s: duration of each step.
        double_support_s: d, duration of the double support.
        rate: w of the inverted pendulum, 1/s.
    """
    growth = math.exp(rate * time_s)
    exponent = rate * double_support_s
    lag = 1.0 - (1.0 - math.exp(-exponent)) / exponent
    travel, across = velocity * time_s, np.array([0.0, side * apart_m])
    offset = travel * (1.0 - growth * lag) / (growth - 1.0) - across * (1.0 + growth * lag) / (growth + 1.0)
    return NominalStep(travel + across, time_s, offset, lag)


def next_step(
    capture: np.ndarray,
    pressure: np.ndarray,
    elapsed_s: float,
    remaining_m: float,
    side: float,
    rate: float,
    nominal: NominalStep,
    limits: StepLimits,
    weights: StepWeights,
) -> NextStep:
    """Position and time of the next touch-down: least squares with three bounded unknowns.

    Args:
        capture: (2,) current capture point.
        pressure: (2,) centre of pressure until touch-down.
        elapsed_s: time since the previous touch-down.
        remaining_m: remaining distance of the foot.
        side: +1.0 if the left foot swings, -1.0 if the right foot swings.
        rate: w of the inverted pendulum, 1/s.
        nominal: step of the steady gait.
        limits: limits of position and time.
        weights: weights of the deviations.
    """
    growth = math.exp(rate * (nominal.time_s - elapsed_s))
    soonest_s = max(limits.time_s[0] - elapsed_s, limits.min_swing_s, remaining_m / limits.speed_m_s)
    latest_s = max(limits.time_s[1] - elapsed_s, soonest_s)
    lateral = sorted((side * limits.apart_m[0], side * limits.apart_m[1]))
    # Of the unknowns (position, growth), the offset is pressure + (capture - pressure) growth - position. The
    # later steps depend on offset + lag * position: a long step needs a smaller offset.
    lead, share = capture - pressure, 1.0 - nominal.lag
    rows = np.array([[-share, 0.0, lead[0]], [0.0, -share, lead[1]]])
    aim = nominal.offset + nominal.lag * nominal.foothold - pressure
    goal = np.array([nominal.foothold[0], nominal.foothold[1], growth])
    diagonal = np.array([weights.place, weights.place, weights.time])
    hessian = weights.offset * (rows.T @ rows)
    hessian.flat[::4] += diagonal
    solution, _, status, _ = daqp.solve(
        hessian,
        -(diagonal * goal + weights.offset * (aim @ rows)),
        np.zeros((0, 3)),
        np.array([limits.ahead_m[1], lateral[1], math.exp(rate * latest_s)]),
        np.array([limits.ahead_m[0], lateral[0], math.exp(rate * soonest_s)]),
    )
    if status <= 0 or not np.all(np.isfinite(solution)):
        return NextStep(nominal.foothold, max(nominal.time_s - elapsed_s, soonest_s))
    return NextStep(np.array(solution[:2]), math.log(solution[2]) / rate)


def capture_after(
    capture: np.ndarray, pressure: np.ndarray, pressure_rate: np.ndarray, time_s: float, rate: float
) -> np.ndarray:
    """Capture point (2,), m, after a time in which the centre of pressure moves uniformly.

    Solution of dx/dt = w (x - p - r t).
    """
    lead = pressure_rate / rate
    return pressure + pressure_rate * time_s + lead + (capture - pressure - lead) * math.exp(rate * time_s)
