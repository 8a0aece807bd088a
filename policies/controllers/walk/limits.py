"""Check of a steady walk: joint rate limit, reach of the legs and static stability margin."""

from typing import NamedTuple

import numpy as np

from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.walk.config import LimitsConfig
from footfall.policies.controllers.walk.feet import stances, steady_cycle
from footfall.policies.controllers.walk.foot import Footing
from footfall.policies.controllers.walk.sway import SwayPlan, sine_at
from footfall.robots.description import Robot
from footfall.robots.support import support_margin

_PROGRESS = np.linspace(0.0, 1.0, 13)
_CLOCKS = (np.arange(24) + 0.5) / 24  # between the phases at which feet lift off or touch down
_PEAK_FACTOR = 1.05  # peak joint rate, relative to the largest mean rate between two samples
_MAX_ERROR_M = 0.003  # largest position error of a foot that counts as reached
_STRIDES = (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)  # shares of the velocity, in the order in which they are tried


class SteadyWalk(NamedTuple):
    """A gait at one velocity."""

    footing: Footing
    timing: GaitTiming
    offsets: np.ndarray  # (feet,)
    velocity: np.ndarray  # (3,)
    step_height_m: float
    sway: SwayPlan
    below_m: np.ndarray  # (feet,) m, depth of a tip in stance below the base's origin


class Pace(NamedTuple):
    """How much a requested walk has to be reduced."""

    stride: float = 1.0  # share of the commanded velocity
    tempo: float = 1.0  # share of the normal speed of time
    reason: str = ""  # reason if either is below 1


class WalkLimits:
    """Finds a pace at which a walk satisfies the robot's limits.

    Args:
        robot: robot with its kinematics and joint rate limit.
        centre: (2,) m, centre of mass relative to the base's origin.
        limits: further limits.
    """

    def __init__(self, robot: Robot, centre: np.ndarray, limits: LimitsConfig) -> None:
        self._robot, self._legs, self._centre, self._limits = robot, robot.legs, centre, limits
        self._max_rate = limits.rate_share * robot.description.target_rate_rad_s

    def pace(self, walk: SteadyWalk) -> Pace:
        """Pace of a steady walk: the longest strides within reach and margin, then the fastest tempo.

        The tempo scales time, not the path: joint rates fall with the tempo.
        """
        reason = ""
        for stride in _STRIDES:
            slower = walk._replace(velocity=stride * walk.velocity)
            problem, rate = self._problem(slower)
            if not problem:
                break
            reason = reason or f"strides are shortened: {problem}"
        else:
            reason = f"the robot does not walk, however short its strides are: {problem}"
        tempo = min(1.0, self._max_rate / max(rate, 1e-9))
        if tempo < 1.0:
            period_s = walk.timing.period_s
            slow = (
                f"the gait is slowed to a period of {period_s / tempo:.2f} s: at {period_s:.2f} s joints"
                f" would move at {rate:.1f} rad/s, {self._max_rate:.1f} are allowed"
            )
            reason = f"{reason}; {slow}" if reason else slow
        return Pace(stride, tempo, reason)

    def _problem(self, walk: SteadyWalk) -> tuple[str, float]:
        """Why a walk is impossible at any tempo (empty if possible), and its peak joint rate, rad/s."""
        feet = steady_cycle(walk.footing, walk.timing, walk.velocity, walk.step_height_m, _PROGRESS)
        feet[:, :, 2] -= walk.below_m
        duty = walk.timing.duty
        clocks = duty + (1.0 - duty) * _PROGRESS[:, None] - walk.offsets  # phases at these points
        feet[:, :, :2] -= sine_at(walk.sway.body, clocks)
        angles = np.array([self._legs.solve(each) for each in feet])
        step_s = walk.timing.swing_s * (_PROGRESS[1] - _PROGRESS[0])
        rate = _PEAK_FACTOR * float(np.abs(np.diff(angles, axis=0)).max()) / step_s
        for each, desired in zip(angles, feet, strict=True):
            reached = self._legs.pose(self._legs.scatter(each, self._robot.default_pose)).foot
            if np.abs(reached - desired).max() > _MAX_ERROR_M:
                return "feet would be out of the legs' reach", rate
        min_margin = self._limits.margin_m
        if min_margin is not None and walk.timing.swing_s > self._limits.dynamic_swing_s:
            points = stances(walk.footing, walk.timing, walk.offsets, walk.velocity, _CLOCKS)
            pressure = self._centre + sine_at(walk.sway.pressure, _CLOCKS)
            margin = min(
                support_margin(stance, (x, y))
                for stance, (x, y) in zip(points, pressure.tolist(), strict=True)
            )
            if margin < min_margin:
                helps = "a shorter gait.period_s, a larger gait.duty or more stance.sway would help"
                return f"the stability margin would be {margin:.3f} m of {min_margin:.3f} m; {helps}", rate
        return "", rate
