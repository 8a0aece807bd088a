"""Checks of a motor's reported torque against its commanded torque.

Expected torques are computed from rounded positions that are older than the motor's own. The effect of
stiffness on these errors is subtracted.
"""

from dataclasses import dataclass

import numpy as np

from footfall.common.arrays import any_nonzero, clamped
from footfall.common.config import require_between
from footfall.common.errors import UserError
from footfall.deploy.sensor_checks.check import JointCheck, Limit
from footfall.deploy.sensor_checks.joint_window import JointWindow
from footfall.deploy.sensor_checks.memory import Memory
from footfall.robots.description import Robot


@dataclass(frozen=True)
class TorqueLimits(Memory):
    """Limits of the disagreement between reported and commanded torques."""

    no_torque_s: float = 0.1  # with much commanded but little reported torque; longer if it is smaller
    opposing: float = 0.3  # mean share of the expected torque that is reported in the other direction
    lag_s: float = 0.03  # delay of a reading and a command together: age of the inputs of the expected torque
    reading_rad: float = 0.002  # error of a position: noise, and rounding in frames
    torque_hidden: float = 0.03  # of the peak torque: may be hidden by friction and rounding
    torque_much: float = 0.06  # of the peak torque: a motor that does not report this much is limp
    torque_some: float = 0.05  # of the peak torque, on average: smaller torque has no significant direction
    torque_little: float = 0.02  # of the peak torque: possible report of a motor without current
    torque_full: float = 0.9  # of the peak torque: above it a motor is saturated
    torque_stuck: float = 0.1  # of the peak torque: change of the expected torque while the report repeats
    repeated_rad: float = 0.1  # travel of a joint's target while its motor repeats one reply

    def __post_init__(self) -> None:
        super().__post_init__()
        require_between(self, 0.01, 10.0, "no_torque_s")
        require_between(self, 0.0, 1.0, "opposing")
        require_between(self, 0.0, 0.1, "lag_s", "reading_rad")
        require_between(self, 0.1, 1.0, "torque_full")
        require_between(self, 0.001, 2.0, "torque_stuck")
        require_between(self, 0.001, 1.0, "torque_hidden", "torque_much", "torque_some", "torque_little")
        require_between(self, 0.001, 2 * np.pi, "repeated_rad")
        if self.torque_hidden >= self.torque_much:
            raise UserError(
                f"torque_hidden is {self.torque_hidden}: it must be below torque_much, {self.torque_much}"
            )


class NoTorque(JointCheck):
    """Time for which a motor has reported no torque while much was expected, s. Any report resets it."""

    quantity = "time for which a motor reports no torque while a large one is commanded: a reboot"
    message = "the motor has reported no torque for {0:.2f} s while torque was commanded"
    limit = Limit("no_torque_s")

    def __init__(self, robot: Robot, limits: TorqueLimits, sample_s: float) -> None:
        peak = robot.motor.peak_torque
        self._n = len(peak)
        self._hidden, self._little = limits.torque_hidden * peak, limits.torque_little * peak
        self._span = (limits.torque_much - limits.torque_hidden) * peak
        self.reset()

    def reset(self) -> None:
        self._no_torque_s = np.zeros(self._n)

    def measure(self, window: JointWindow) -> np.ndarray:
        little = window.strongest <= self._little
        if not any_nonzero(little):
            self.reset()
            return self._no_torque_s
        expected = clamped((window.certain - self._hidden) / self._span, 0.0, 1.0)
        self._no_torque_s = little * (self._no_torque_s + window.elapsed_s * expected)
        return self._no_torque_s


class Opposing(JointCheck):
    """Mean share of the expected torque that a motor reports in the other direction.

    A late motor still follows an older target: the torque by the target's lead is subtracted.
    """

    quantity = "reported torque against the commanded direction, as a share of the commanded torque"
    message = "the motor pulls the other way by {0:.0%} of the torque that was commanded"
    limit = Limit("opposing")

    def __init__(self, robot: Robot, limits: TorqueLimits, sample_s: float) -> None:
        peak = robot.motor.peak_torque
        self._n, self._limits = len(peak), limits
        self._min_sq = (limits.torque_some * peak) ** 2
        self.reset()

    def reset(self) -> None:
        self._product, self._expected_sq = np.zeros((2, self._n))  # (N m)^2, decaying means

    def measure(self, window: JointWindow) -> np.ndarray:
        lead = np.maximum(window.target_speed - window.speed, 0.0)
        late = window.stiffness * self._limits.lag_s * lead
        certain = np.maximum(window.certain - late, 0.0)
        kept = self._limits.kept(window.elapsed_s)
        signed = np.copysign(certain, window.expected)
        self._product = kept * self._product + (1.0 - kept) * window.torque * signed
        self._expected_sq = kept * self._expected_sq + (1.0 - kept) * certain * certain
        return -self._product / np.maximum(self._expected_sq, self._min_sq)


class TorqueStuck(JointCheck):
    """Change of the expected torque while a motor repeats one report, as a share of its peak torque.

    The last window is excluded, because a late motor has not replied to it. The hidden part is excluded, too;
    the rest is summed. A saturated motor repeats its report, and so does a motor with a constant command: the
    sum is limited to the difference between report and command.
    """

    quantity = "change of the expected torque while the reported torque is constant: stuck, or rebooted"
    message = (
        "the motor repeats one torque while its expected torque changed by {0:.0%}: it may have rebooted"
    )
    limit = Limit("torque_stuck")

    def __init__(self, robot: Robot, limits: TorqueLimits, sample_s: float) -> None:
        self._peak, self._reading_rad = robot.motor.peak_torque, limits.reading_rad
        self._n = len(self._peak)
        self._hidden, self._full = limits.torque_hidden * self._peak, limits.torque_full * self._peak
        self.reset()

    def reset(self) -> None:
        self._zeros = np.zeros(self._n)
        self._share = self._before = self._at_start = self._zeros  # expected torques in N m

    def measure(self, window: JointWindow) -> np.ndarray:
        if not window.any_repeated:
            self._share, self._before, self._at_start = self._zeros, window.expected, window.expected
            return self._zeros
        repeats = window.repeated[2] & (window.strongest < self._full)
        change = np.abs(self._before - self._at_start)
        change = np.minimum(change, np.abs(self._before - window.torque))
        significant = np.maximum(change - self._hidden - window.stiffness * self._reading_rad, 0.0)
        self._share = repeats * (self._share + significant / self._peak)
        self._at_start = np.where(repeats, self._at_start, window.expected)
        self._before = window.expected
        return self._share


class ReplyRepeated(JointCheck):
    """Travel of a joint's target while its motor repeats one reply, rad; 0 if there is an explanation.

    A reading is older than the last target, which may jump while a robot stands still: targets count from the
    previous window. A joint pressed against its stop, the ground or another limb also repeats its reply
    while its motor is saturated. Then the expected torque stays as in the first window with this reply.
    """

    quantity = "travel of a joint target while its motor repeats one reply and the expected torque changes"
    message = "it repeats one reading while its target moved by {0:.2f} rad"
    limit = Limit("repeated_rad")

    def __init__(self, robot: Robot, limits: TorqueLimits, sample_s: float) -> None:
        self._n, self._reading_rad = len(robot.joint_names), limits.reading_rad
        self._hidden = limits.torque_hidden * robot.motor.peak_torque
        self.reset()

    def reset(self) -> None:
        self._zeros, self._none = np.zeros(self._n), np.zeros(self._n, bool)
        self._travel = self._before = self._at_start = self._zeros  # rad, and expected N m
        self._repeated = self._none  # in the previous window

    def measure(self, window: JointWindow) -> np.ndarray:
        if not window.any_repeated:
            self._travel, self._before, self._at_start = self._zeros, window.expected, window.expected
            self._repeated = self._none
            return self._zeros
        position, velocity, torque = window.repeated
        repeats = position & velocity & torque
        self._at_start = np.where(repeats & self._repeated, self._at_start, window.expected)
        change = np.abs(self._before - self._at_start)
        changed = self._repeated & (change > self._hidden + window.stiffness * self._reading_rad)
        self._travel = repeats * (self._travel + window.target_travel)
        self._before, self._repeated = window.expected, repeats
        return changed * self._travel
