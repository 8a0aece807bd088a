"""Simulated IMUs: readings to frames."""

from typing import Protocol

import numpy as np

from footfall.common.errors import UserError
from footfall.common.outside import find
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import imu_driver_class
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring


class ImuEnd(Protocol):
    """The IMU's end of a protocol. A driver of one's own names it as `imu_end` (`drivers/imu_driver.py`)."""

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
        sent = len(self.identifiers)
        self._channel, self._id, self._length = (
            np.full(sent, channel),
            np.array(self.identifiers),
            np.full(sent, 8),
        )
        self._counter = 0

    def encode(self, reading: imu.Inertial) -> Frames:
        self._counter += 1
        data = imu.encode(reading, self._counter)[: len(self._id)]
        return Frames(self._channel, self._id, data, self._length)


class InertialImuEnd(FootfallImuEnd):
    """The same without orientation."""

    identifiers = imu.IDS[:2]


def open_imu_end(wiring: Wiring) -> ImuEnd:
    """The simulated IMU of a robot.

    Raises:
        UserError: its protocol has none.
    """
    driver = imu_driver_class(wiring.imu_protocol)
    if not driver.imu_end:
        raise UserError(f"imu_protocol '{wiring.imu_protocol}' has no simulated IMU: it names no imu_end")
    end: type[ImuEnd] = find(driver.imu_end, "simulated IMU")
    return end(wiring.imu_channel)
