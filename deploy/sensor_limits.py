"""How far readings may contradict each other before the robot is damped."""

import math
from dataclasses import dataclass

from footfall.common.config import require_between
from footfall.common.errors import UserError


@dataclass(frozen=True)
class SensorLimits:
    """How far readings may contradict each other.

    The defaults are at least 1.6 times the most that simulated robots gave while they walked, randomised,
    pushed and with noisy sensors (docs/safety.md).
    """

    period_s: float = 0.04  # between two looks; a fault is seen within a few of them
    memory_s: float = 0.25  # over which contradictions add up; what is older fades
    position_rad: float = 0.2  # beyond a joint's range: stops give way, and calibration is never exact
    drift_rad: float = 0.02  # a joint's ways by its position and by its velocity apart, less a share
    drift_share: float = 0.2  # that a velocity filtered over 5 ms takes up
    drift_memory_s: float = 0.5  # over which ways apart add up
    wander_rad: float = 0.05  # the same ways apart, with their signs: of an encoder that drifts
    stuck_rad: float = 0.01  # the same, of a joint whose position or velocity repeats itself
    filter_s: float = 0.005  # that a motor's velocity is behind its position
    speed_share: float = 1.5  # of the no-load speed: a push or a fall drives a motor beyond it
    torque_share: float = 1.2  # of the peak torque: rounding, and a motor's own idea of its constant
    voltage_v: float = 0.0  # that a supply may be outside its range
    limp_s: float = 0.1  # that a motor reports little torque while much is commanded; longer if it is less
    opposing: float = 0.3  # share of the expected torque that it reports in the other direction, on average
    lag_s: float = 0.03  # of a reading and of a command together: what a torque was predicted from is older
    reading_rad: float = 0.002  # that a position is known to: noise, and rounding in frames
    torque_hidden: float = 0.03  # of the peak torque: what friction and rounding can hide
    torque_much: float = 0.06  # of the peak torque: a motor that does not report this much is limp
    torque_some: float = 0.05  # of the peak torque, on average: less has no direction that counts
    torque_little: float = 0.02  # of the peak torque: what a motor without current may report
    torque_full: float = 0.9  # of the peak torque: a motor that reports more gives all that it can
    torque_stuck: float = 0.1  # of the peak torque: way of the expected one while a motor repeats its report
    repeated_rad: float = 0.1  # way of a joint's target while its motor repeats one reply
    rotation_rad: float = 0.08  # the base's turn by the quaternion against the one by the gyro
    imu_repeated_s: float = 0.03  # that a part of the IMU repeats itself while joints move
    turned_rad: float = 0.001  # of the base between two looks: less is no turn, and rounding can hide it
    moving_rad_s: float = 0.5  # of the fastest joint: then a body shakes by more than an IMU's last digit
    resting_rad_s: float = 0.3  # of every joint and of the base: slower than that for `resting_s` is rest
    resting_s: float = 0.3
    rest_error: float = 0.15  # of gravity: acceleration at rest against the quaternion's idea of up
    lean_error: float = 0.35  # of gravity: the same in motion, on average, sideways
    lift_error: float = 0.6  # of gravity: upwards; a robot that is thrown or falls over feels less of it
    sunk: float = 0.55  # of the base's clearance when standing: how much may be gone
    slope_rad: float = 0.35  # of the ground that a robot may stand on, by its legs and the IMU
    leg_turn_rad: float = 0.05  # of the base that stands, by the IMU other than by the legs
    loaded_share: float = 0.2  # of an even share of the weight: a foot that bears less does not stand
    lean_memory_s: float = 1.0  # over which a walk's accelerations cancel out

    def __post_init__(self) -> None:
        require_between(self, 0.001, 0.2, "period_s")
        require_between(
            self, 0.01, 10.0, "memory_s", "drift_memory_s", "imu_repeated_s", "resting_s", "lean_memory_s"
        )
        require_between(
            self,
            0.001,
            math.tau,
            "position_rad",
            "drift_rad",
            "wander_rad",
            "stuck_rad",
            "repeated_rad",
            "rotation_rad",
            "turned_rad",
        )
        require_between(self, 0.0, 1.0, "drift_share", "opposing")
        require_between(self, 0.1, 1.0, "sunk")
        require_between(self, 0.01, 1.5, "slope_rad", "leg_turn_rad")
        require_between(self, 0.01, 1.0, "loaded_share")
        require_between(self, 0.01, 2.0, "rest_error", "lean_error", "lift_error")
        require_between(self, 0.01, 10.0, "limp_s")
        require_between(self, 0.0, 0.1, "lag_s", "filter_s", "reading_rad")
        require_between(self, 0.1, 1.0, "torque_full")
        require_between(self, 0.001, 2.0, "torque_stuck")
        require_between(self, 0.001, 1.0, "torque_hidden", "torque_much", "torque_some", "torque_little")
        if self.torque_hidden >= self.torque_much:
            raise UserError(
                f"torque_hidden is {self.torque_hidden}: it must be below torque_much, {self.torque_much}"
            )
        require_between(self, 0.01, 100.0, "moving_rad_s", "resting_rad_s")
        require_between(self, 1.0, 10.0, "speed_share", "torque_share")
        require_between(self, 0.0, 100.0, "voltage_v")
