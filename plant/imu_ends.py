"""Simulated IMUs: readings to frames."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from footfall.common.errors import UserError
from footfall.common.outside import find
from footfall.deploy.drivers import imu, vectornav, xbus, xsens_can
from footfall.deploy.drivers.choice import imu_driver_class
from footfall.deploy.drivers.serial_imu import Sample, to_frames
from footfall.deploy.frames import Frames, no_frames
from footfall.deploy.wiring import Wiring

IMU_PERIOD_S = 0.002


class ImuEnd(Protocol):
    """The IMU's end of a protocol. A user's own driver names it in `imu_end` (`drivers/imu_driver.py`)."""

    def __init__(self, channel: int) -> None:
        """`channel` is the index of the IMU's bus."""
        ...

    def encode(self, reading: imu.Inertial) -> Frames:
        """Frames of the next sample: gyro rad/s, acceleration m/s^2, unit quaternion, all in body axes."""
        ...


class FootfallImuEnd:
    """An IMU with footfall's own format."""

    identifiers: tuple[int, ...] = imu.IDS  # of the frames that it sends

    def __init__(self, channel: int) -> None:
        count = len(self.identifiers)
        self._channel, self._id, self._length = (
            np.full(count, channel),
            np.array(self.identifiers),
            np.full(count, 8),
        )
        self._counter = 0

    def encode(self, reading: imu.Inertial) -> Frames:
        self._counter += 1
        data = imu.encode(reading, self._counter)[: len(self._id)]
        return Frames(self._channel, self._id, data, self._length)


class InertialImuEnd(FootfallImuEnd):
    """An IMU with footfall's own format, without orientation."""

    identifiers = imu.IDS[:2]


class XsensCanEnd:
    """An Xsens MTi on CAN."""

    def __init__(self, channel: int) -> None:
        self._channel, self._id = np.full(len(xsens_can.IDS), channel), np.array(xsens_can.IDS)
        self._length = np.array([xsens_can.LENGTHS[identifier] for identifier in xsens_can.IDS])
        self._counter = 0

    def encode(self, reading: imu.Inertial) -> Frames:
        self._counter += 1
        return Frames(self._channel, self._id, xsens_can.encode(reading, self._counter), self._length)


class SerialEnd:
    """An IMU on a serial port. Its bytes take the time of CAN frames, as simulated wires carry only these."""

    message: Callable[[Sample], bytes]  # bytes of a sample

    def __init__(self, channel: int) -> None:
        self._channel, self._counter = channel, 0

    def encode(self, reading: imu.Inertial) -> Frames:
        self._counter += 1
        return to_frames(self._channel, self.message(Sample(self._counter, reading)))


class XbusEnd(SerialEnd):
    """An Xsens MTi on a serial port."""

    message = staticmethod(xbus.encode)


class VectorNavEnd(SerialEnd):
    """A VectorNav VN-100: one sample each millisecond, by its own clock."""

    message = staticmethod(vectornav.encode)


def open_imu_end(wiring: Wiring) -> ImuEnd:
    """The simulated IMU of a robot.

    Raises:
        UserError: its driver has no simulated IMU.
    """
    driver = imu_driver_class(wiring.imu_protocol)
    if not driver.imu_end:
        raise UserError(f"imu_protocol '{wiring.imu_protocol}' has no simulated IMU: it names no imu_end")
    end: type[ImuEnd] = find(driver.imu_end, "simulated IMU")
    return end(wiring.imu_channel)


class SimulatedImu:
    """A robot's IMU, which samples at its own rate."""

    def __init__(self, wiring: Wiring, step_s: float) -> None:
        """`step_s` is the physics step."""
        self._end, self._frames = open_imu_end(wiring), no_frames()
        self._period_steps = round(IMU_PERIOD_S / step_s)

    def due(self, step: int) -> bool:
        """Whether a sample is due in this physics step."""
        return step % self._period_steps == 0

    def frames(self, measure: Callable[[], imu.Inertial], stuck: bool) -> Frames:
        """Frames of the next sample; a stuck IMU repeats its last one."""
        if not stuck:
            self._frames = self._end.encode(measure())
        return self._frames
