"""Interface of IMU protocols for the control loop.

An external driver is a class that `imu_protocol` in robot.yaml names as MODULE:NAME. It may have `older`, the
number of samples so far whose counter was older than the latest: then replayed frames are detected, too.
The driver of an IMU without orientation has `orientation = False`, and any unit quaternion in its readings:
an attitude filter replaces it (`oriented_imu.py`). The driver of a serial port has `serial = True`, and gets
the bytes as frames (`serial_imu.py`); `damaged` counts messages with a wrong checksum.
"""

from typing import Protocol

from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.frames import Frames


class ImuDriver(Protocol):
    """Decodes the frames of one IMU. Its axes are those of the robot's base: x forward, y left, z up."""

    filters: tuple[CanFilter, ...]  # filters for the frames of the IMU
    identifiers: tuple[int, ...]  # all identifiers that it sends; those with 29 bits include EXTENDED
    imu_end: str  # MODULE:NAME of the simulated IMU (`plant/imu_ends.py`); empty for none

    def __init__(self, channel: int) -> None:
        """`channel` is the index of the IMU's bus."""
        ...

    @property
    def reading(self) -> Inertial:
        """Latest reading: gyro rad/s, proper acceleration m/s^2, unit quaternion w x y z to the world."""
        ...

    @property
    def arrived_us(self) -> int | None:
        """Arrival time of the oldest part of the reading, us; None until each part has arrived.
        A repeated sample does not change it: the reading of a stuck IMU must become old.
        """
        ...

    @property
    def oldest(self) -> str:
        """Name of the oldest part: a field of `Inertial`."""
        ...

    def absorb(self, frames: Frames, now_us: int) -> None:
        """Decode frames; those of other senders, and incomplete ones, are ignored.
        The time of a part is that of its frame (`Frames.time_us`), or `now_us` if that is unknown.
        """
        ...
