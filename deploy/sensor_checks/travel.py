"""Checks of a joint's travel: by its position against by its velocity."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from footfall.common.arrays import clamped
from footfall.common.config import require_between
from footfall.deploy.sensor_checks.check import JointCheck, Limit
from footfall.deploy.sensor_checks.joint_window import JointWindow
from footfall.robots.description import Robot

CREEP_RAD_S = 0.25  # largest rate of a creeping drift: a sudden error is for the other checks
REST_S = 0.2  # time without motion that counts as rest: a stance is shorter, and belongs to its stride
IMPACT_S = 0.01  # of a foot's touch-down: with larger intervals readings miss the velocity's change


@dataclass(frozen=True)
class TravelLimits:
    """Limits of the disagreement between positions and velocities."""

    drift_rad: float = 0.02  # root of the summed squared errors, minus a share of the travel
    drift_share: float = 0.2  # of the travel, for a velocity that is filtered over 5 ms
    drift_memory_s: float = 0.5  # time constant with which errors decay
    wander_rad: float = 0.05  # sum of the signed errors: a drifting encoder
    creep_rad: float = 0.03  # signed sum over `creep_memory_s`, which includes noise
    creep_memory_s: float = 5.0
    creep_rad_s: float = 0.1  # smallest speed: below it the quantisation of the velocity hides the drift
    creep_share: float = 0.03  # of the largest error of the velocity between two readings
    stuck_rad: float = 0.01  # signed sum, while position or velocity repeats itself
    filter_s: float = 0.005  # lag of a motor's velocity relative to its position

    def __post_init__(self) -> None:
        require_between(self, 0.001, 2 * np.pi, "drift_rad", "wander_rad", "creep_rad", "stuck_rad")
        require_between(self, 0.0, 1.0, "drift_share", "creep_share")
        require_between(self, 0.01, 10.0, "drift_memory_s", "creep_memory_s")
        require_between(self, 0.0, 0.1, "filter_s")
        require_between(self, 0.0, 10.0, "creep_rad_s")


class Drift(JointCheck):
    """Root of the summed squared errors between position and velocity, minus a share of the travel, rad.

    Squares do not cancel out when a joint moves back and forth. A share of the travel is allowed because a
    motor that filters its velocity lags, more so at larger intervals of readings. Readings at uneven
    intervals may each be late by the difference between the oldest and the youngest age.
    """

    quantity = "a joint's travel by position against its travel by velocity: an encoder jumps or is swapped"
    message = "its position changed by {0:.2f} rad against its velocity"
    limit = Limit("drift_rad")

    def __init__(self, robot: Robot, limits: TravelLimits, sample_s: float) -> None:
        self._n, self._memory_s = len(robot.joint_names), limits.drift_memory_s
        self._share = limits.drift_share * max(1.0, sample_s / IMPACT_S)
        self.reset()

    def reset(self) -> None:
        self._error_sq, self._travel_sq, self._uneven_s = np.zeros((3, self._n))

    def measure(self, window: JointWindow) -> np.ndarray:
        error, travel = window.position_error, window.travel
        kept = math.exp(-window.elapsed_s / self._memory_s)
        self._error_sq = kept * self._error_sq + error * error
        self._travel_sq = kept * self._travel_sq + np.maximum(travel * travel, (travel + error) ** 2)
        self._uneven_s = np.maximum(kept * self._uneven_s, window.late_s)
        share = self._share + self._uneven_s / window.elapsed_s
        return np.sqrt(self._error_sq) - share * np.sqrt(self._travel_sq)


class _SignedTravel(JointCheck):
    """Sum of the signed errors, minus the effect of late velocities, rad."""

    memory: ClassVar[str] = "drift_memory_s"  # field of `TravelLimits`

    def __init__(self, robot: Robot, limits: TravelLimits, sample_s: float) -> None:
        self._n, self._memory_s = len(robot.joint_names), getattr(limits, self.memory)
        self.reset()

    def reset(self) -> None:
        self._error = np.zeros(self._n)  # rad; decays

    def _updated(self, window: JointWindow, error: np.ndarray) -> np.ndarray:
        """Sum after another window with this error, rad, (n,)."""
        self._error = self._kept(window) * self._error + error
        total: np.ndarray = np.abs(self._error) - window.late_travel
        return total

    def _kept(self, window: JointWindow) -> float:
        """Remaining share of the sum before the window."""
        return math.exp(-window.elapsed_s / self._memory_s)


class Wander(_SignedTravel):
    """Signed error, for a drifting encoder."""

    quantity = "signed sum of errors of position against velocity: an encoder drifts"
    message = "its position has drifted by {0:.2f} rad against its velocity"
    limit = Limit("wander_rad")

    def measure(self, window: JointWindow) -> np.ndarray:
        return self._updated(window, window.position_error)


class Creep(_SignedTravel):
    """Signed error, for a slowly drifting encoder, until its joint has rested for a while.

    The resolution of a velocity causes an error that is constant while a joint rests. A stride counts as a
    whole: the error that an impact adds to one window is missing in its neighbour, which may be a slow one.
    Windows with uneven intervals of readings are ignored. A velocity that jumps between two readings, as at
    a foot's touch-down, makes the travel uncertain by half of the jump times that interval. These errors
    mostly cancel out, but not in a gait synchronous with the readings: `creep_share` of their sum is allowed.
    """

    memory = "creep_memory_s"
    quantity = "signed sum of these errors over seconds: an encoder drifts slowly"
    message = "its position has crept by {0:.2f} rad against its velocity"
    limit = Limit("creep_rad")

    def __init__(self, robot: Robot, limits: TravelLimits, sample_s: float) -> None:
        self._min_rad_s = limits.creep_rad_s
        self._uncertain_s = limits.creep_share * 0.25 * sample_s  # a jump shows in two second differences
        # Of a sum of velocities that may miss an impact.
        self._trusted_share = min(1.0, 0.5 * IMPACT_S / sample_s)
        super().__init__(robot, limits, sample_s)

    def reset(self) -> None:
        super().reset()
        self._jolts = np.zeros(self._n)  # rad/s; decay
        self._rest_s = np.full(self._n, np.inf)  # since the joint moved

    def measure(self, window: JointWindow) -> np.ndarray:
        self._rest_s = np.where(window.speed > self._min_rad_s, 0.0, self._rest_s + window.elapsed_s)
        used = (self._rest_s < REST_S) & (window.late_s < 0.5 * IMPACT_S)
        self._jolts = self._kept(window) * self._jolts + used * window.jolts
        bound = CREEP_RAD_S * window.elapsed_s
        total = self._updated(window, used * clamped(window.position_error, -bound, bound))
        total -= self._uncertain_s * self._jolts
        return total if self._trusted_share == 1.0 else self._trusted_share * total


class Stuck(_SignedTravel):
    """Signed error while position or velocity repeats exactly."""

    quantity = "signed sum of these errors while position or velocity is constant: an encoder is stuck"
    message = "its position or velocity repeats itself, {0:.3f} rad against the other one"
    limit = Limit("stuck_rad")

    def measure(self, window: JointWindow) -> np.ndarray:
        if not window.any_repeated:
            self.reset()
            return -window.late_travel
        position, velocity, _ = window.repeated
        repeated = position | velocity
        self._error = repeated * self._error
        return self._updated(window, repeated * window.position_error)
