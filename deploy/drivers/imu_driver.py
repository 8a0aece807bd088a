"""What the control loop requires of an IMU's protocol.

A driver of one's own is a class that `imu_protocol` in robot.yaml names as MODULE:NAME. It may have `older`,
the number of samples so far that were older than the latest: then replays are noticed by their counters, too.
The driver of an IMU that gives no orientation has `orientation = False`, and any unit quaternion in its
readings: an attitude filter replaces it (`oriented_imu.py`). One on a serial port has `serial = True`, and
reads its bytes in frames (`serial_imu.py`); `damaged` counts messages with a wrong checksum.
"""

from typing import Protocol

from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.frames import Frames


class ImuDriver(Protocol):
    """Decodes the frames of one IMU. Its axes are those of the robot's base: x forward, y left, z up."""

    filters: tuple[CanFilter, ...]  # which frames the IMU sends
    identifiers: tuple[int, ...]  # all identifiers that it sends; one of 29 bits has EXTENDED added
    imu_end: str  # MODULE:NAME of the simulated IMU (`plant/imu_ends.py`); empty for none

    def __init__(self, channel: int) -> None:
        """`channel` is the index of the IMU's bus."""
        ...

    @property
    def reading(self) -> Inertial:
        """The latest reading: gyro rad/s, proper acceleration m/s^2, unit quaternion w x y z to the world."""
        ...

    @property
    def heard_us(self) -> int | None:
        """Arrival time of the oldest part of the reading, us; None until each part has arrived once.

        A repeated sample does not count as heard: a stuck IMU must grow old.
        """
        ...

    @property
    def oldest(self) -> str:
        """Name of that part: a field of `Inertial`."""
        ...

    def absorb(self, frames: Frames, now_us: int) -> None:
        """Decode frames; those of other senders, and incomplete ones, are left out.

        A part's time is that of its frame (`Frames.time_us`), or `now_us` where that is unknown.
        """
        ...
