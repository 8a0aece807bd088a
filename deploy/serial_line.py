"""A serial port in place of a CAN interface: bytes of an IMU as frames (`deploy/drivers/serial_imu.py`)."""

from typing import Any, NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.common.installation import needs_extra
from footfall.deploy.bus import Bus, BusStatistics
from footfall.deploy.drivers.serial_imu import to_frames
from footfall.deploy.frames import Frames
from footfall.robots.robot_yaml import SERIAL

BAUD = 921_600  # if the name has none


class Port(NamedTuple):
    """A serial port from its name in robot.yaml: `serial:/dev/ttyUSB0@460800`."""

    path: str
    baud: int


def port_of(name: str) -> Port:
    """Port from the name of a bus.

    Raises:
        UserError: the name has another form.
    """
    path, at, baud = name.removeprefix(SERIAL).partition("@")
    if not path or (at and not baud.isdecimal()):
        raise UserError(f"bus '{name}': expected a name such as serial:/dev/ttyUSB0@{BAUD}")
    return Port(path, int(baud) if at else BAUD)


class SerialLine:
    """One serial port, read without blocking. A failing port becomes silent, with a line in `fault`."""

    def __init__(self, name: str, channel: int) -> None:
        """Open the port of a bus; `channel` is its index.

        Raises:
            UserError: pyserial is not installed, or the port cannot be opened.
        """
        with needs_extra("serial", "an IMU on a serial port needs"):
            import serial
        port = port_of(name)
        self._channel, self._failure = channel, ""
        self.statistics = BusStatistics(name)
        try:
            self._port: Any = serial.Serial(port.path, port.baud, timeout=0, exclusive=True)
        except (OSError, ValueError) as error:
            raise UserError(f"cannot open bus '{name}': {' '.join(str(error).split())}") from None

    def receive(self, now_us: int) -> list[Frames]:
        """Received bytes. The kernel does not stamp them: their time is that of the call."""
        if self._failure:
            return []
        try:
            content = self._port.read(self._port.in_waiting)
        except OSError as error:  # e.g. an unplugged adapter
            self._failure = f"bus {self.statistics.name} failed: {' '.join(str(error).split())}"
            return []
        if not content:
            return []
        frames = to_frames(self._channel, content)
        self.statistics.frames_received += len(frames.id)
        return [frames.at(np.full(len(frames.id), now_us))]

    @property
    def fault(self) -> str:
        """Reason for a failure of the port, in one line; empty if it works."""
        return self._failure

    def close(self) -> None:
        """Close the port."""
        self._port.close()


class WithSerialLine:
    """CAN interfaces, and a serial port as one of the robot's buses. Its frames do not go to the
    interfaces."""

    def __init__(self, can: Bus, line: SerialLine, channel: int) -> None:
        """`channel` is the port's index among the robot's buses; the interfaces have the others, in order."""
        self._can, self._line, self._channel = can, line, channel

    def send(self, frames: Frames, now_us: int) -> int:
        channel = frames.channel
        if (channel < self._channel).all():
            return self._can.send(frames, now_us)
        kept = frames.take(channel != self._channel)
        return self._can.send(kept._replace(channel=kept.channel - (kept.channel > self._channel)), now_us)

    def receive(self, now_us: int) -> list[Frames]:
        batches = [
            frames._replace(channel=frames.channel + (frames.channel >= self._channel))
            for frames in self._can.receive(now_us)
        ]
        return [*batches, *self._line.receive(now_us)]

    def fault(self) -> str:
        return self._can.fault() or self._line.fault

    def statistics(self) -> list[BusStatistics]:
        can_statistics = self._can.statistics()
        return [*can_statistics[: self._channel], self._line.statistics, *can_statistics[self._channel :]]

    def close(self) -> None:
        self._can.close()
        self._line.close()
