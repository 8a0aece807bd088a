"""Latest readings of a robot's motors, IMU and feet, from frames as they arrive."""

from typing import NamedTuple

import numpy as np

from footfall.common.arrays import any_nonzero
from footfall.common.bounded_cache import BoundedCache
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.drivers.foot_force import FootForceReader
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.drivers.imu_driver import ImuDriver
from footfall.deploy.frames import Frames
from footfall.policies.policy import Sensed
from footfall.robots.readings import NO_FORCES

NEVER_US = -(10**15)  # microseconds: long ago
_NO_ROWS = np.zeros(0, np.intp)


class LastArrivals(NamedTuple):
    """Times of the latest readings, microseconds of the loop's clock, and the motors' error codes."""

    motor_us: np.ndarray  # (n,)
    imu_us: int  # the oldest part of the IMU's reading
    motor_error: np.ndarray  # (n,) error codes


class MotorHealth(NamedTuple):
    """Age of the latest readings and reported state of n motors."""

    age_s: np.ndarray  # (n + 1,) age of each motor's reading, and of the oldest part of the IMU's
    temperature_c: np.ndarray  # (n,) NaN if not reported
    voltage: np.ndarray  # (n,) V, NaN if not reported
    error: np.ndarray  # (n,) codes, 0 for none


class Receiver:
    """Decodes frames of motors and sensors. Returned arrays do not change afterwards."""

    def __init__(
        self, driver: Driver, imu: ImuDriver, joints: int, feet: FootForceReader | None = None
    ) -> None:
        """`joints` is the number of the robot's joints; `feet` is None without force sensors."""
        self._driver, self._imu, self._feet = driver, imu, feet
        self._imu_ids = np.array(imu.identifiers)
        self._rows_of = BoundedCache[bytes, tuple[np.ndarray, ...]]()  # by identifiers
        self._now_us = NEVER_US
        self.joints = np.zeros((3, joints))  # latest position rad, velocity rad/s and torque N m
        self.temperature_c = np.full(joints, np.nan)  # latest; NaN if not reported
        self.voltage = np.full(joints, np.nan)  # V, the same
        self.current = np.full(joints, np.nan)  # A, the same
        self._motor_us = np.full(joints, NEVER_US)
        self._error = np.zeros(joints, dtype=np.uint8)
        self._absorbed_us = NEVER_US  # time of the latest replies
        self._whole_batches = 0  # number of batches with one reply of each motor
        self._single_replies = np.zeros(joints, np.intp)  # number of replies in other batches

    def absorb(self, batches: list[Frames], now_us: int) -> None:
        """Decode received frames; frames of other senders are ignored."""
        self._now_us = now_us
        for frames in batches:
            from_imu, from_feet, from_motors = self._rows(frames)
            if len(from_motors) == len(frames.id):
                self._absorb_replies(frames, now_us)
            elif len(from_imu) == len(frames.id):
                self._imu.absorb(frames, now_us)
            else:
                self._imu.absorb(frames.take(from_imu).can_frames(), now_us)
                if self._feet is not None:
                    self._feet.absorb(frames.take(from_feet).can_frames(), now_us)
                self._absorb_replies(frames.take(from_motors), now_us)

    def _rows(self, frames: Frames) -> tuple[np.ndarray, ...]:
        """Rows of the IMU's, the feet's and other frames, cached by identifiers: `np.isin` takes 15 us."""
        key = frames.id.tobytes()
        rows = self._rows_of.get(key)
        if rows is None:
            from_imu = np.isin(frames.id, self._imu_ids)
            from_feet = _NO_ROWS
            if self._feet is not None:
                from_feet = np.flatnonzero(np.isin(frames.id, self._feet.identifiers))
            rest = ~from_imu
            rest[from_feet] = False
            rows = self._rows_of[key] = np.flatnonzero(from_imu), from_feet, np.flatnonzero(rest)
        return rows

    def sensed(self) -> Sensed:
        """Latest readings."""
        gyro, acceleration, quaternion = self._imu.reading
        joints = self.joints[0], self.joints[1], self.joints[2]
        force = NO_FORCES if self._feet is None else self._feet.force(self._now_us)
        return Sensed(np.array(gyro), np.array(acceleration), np.array(quaternion), *joints, force)

    @property
    def inertial(self) -> Inertial:
        """Latest reading of the IMU."""
        return self._imu.reading

    @property
    def oldest_of_imu(self) -> str:
        """Name of the oldest part of the IMU's reading."""
        return self._imu.oldest

    def last_arrivals(self) -> LastArrivals:
        """Arrival times of the latest readings."""
        imu_us = self._imu.arrived_us
        return LastArrivals(self._motor_us, NEVER_US if imu_us is None else imu_us, self._error)

    @property
    def replies(self) -> np.ndarray:
        """Number of replies of each motor so far, (n,)."""
        return self._single_replies + self._whole_batches

    @property
    def imu_older(self) -> int:
        """Number of the IMU's samples so far that were older than its latest; 0 if its driver does not
        count."""
        return getattr(self._imu, "older", 0)

    @property
    def imu_damaged(self) -> int:
        """Number of the IMU's messages so far with a wrong checksum; 0 if its driver does not check."""
        return getattr(self._imu, "damaged", 0)

    def health(self, now_us: int) -> MotorHealth:
        """Age of the latest readings and state of the motors."""
        motor_us, imu_us, error = self.last_arrivals()
        age_us = np.empty(len(motor_us) + 1)
        age_us[:-1], age_us[-1] = now_us - motor_us, now_us - imu_us
        return MotorHealth(1e-6 * age_us, self.temperature_c, self.voltage, error)

    def _absorb_replies(self, frames: Frames, now_us: int) -> None:
        motor, values, error, temperature, voltage, arrived_us, current = self._driver.replies(frames)
        same_tick = self._absorbed_us == now_us
        earlier_errors = self._error if same_tick and any_nonzero(self._error) else None
        if isinstance(motor, slice):
            self._whole_batches += 1
            self.joints, self._error = values, error
            self.temperature_c, self.voltage = temperature, voltage
            if current is not None:
                self.current = current
        else:
            np.add.at(self._single_replies, motor, 1)
            self.joints = self.joints.copy()
            self.temperature_c, self.voltage = self.temperature_c.copy(), self.voltage.copy()
            self.joints[:, motor] = values
            self.temperature_c[motor], self.voltage[motor] = temperature, voltage
            if current is not None:
                self.current = self.current.copy()
                self.current[motor] = current
            self._error = self._error.copy()
            self._error[motor] = 0
            np.maximum.at(self._error, motor, error)
        if earlier_errors is not None:
            self._error = np.maximum(
                self._error, earlier_errors
            )  # an error outlives later replies of its tick
        self._absorbed_us = now_us
        self._motor_us[motor] = now_us if arrived_us is None else arrived_us
