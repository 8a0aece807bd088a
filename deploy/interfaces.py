"""Opens the CAN interfaces of a robot, by kind of interface."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from footfall.common.errors import UserError
from footfall.common.locks import locked
from footfall.deploy.bus import HOST_QUEUE, Bus
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import takes_fd
from footfall.deploy.python_can_bus import MULTICAST, MULTICAST_GROUP, MULTICAST_PORT, PythonCanBus
from footfall.deploy.serial_line import SerialLine, WithSerialLine
from footfall.deploy.socketcan_bus import SOCKETCAN, SocketCanBus
from footfall.robots.robot_yaml import SERIAL

VIRTUAL = "virtual"
SIMULATED = (VIRTUAL, MULTICAST)  # on these, frames of a serial line travel like all others


def open_interfaces(
    kind: str, names: tuple[str, ...], filters: tuple[CanFilter, ...], queue_frames: int = HOST_QUEUE
) -> Bus:
    """Open all buses of a robot.

    Args:
        kind: `socketcan` (Linux), or another python-can interface.
        names: names of the buses.
        filters: a frame is received if it passes one of them.
        queue_frames: length of an interface's transmit queue.

    Raises:
        UserError: there is no such kind of interface, or one of the buses cannot be opened.
    """
    serial = next((name for name in names if name.startswith(SERIAL)), None)
    if serial is not None and kind not in SIMULATED:
        channel = names.index(serial)
        line = SerialLine(serial, channel)
        try:
            others = names[:channel] + names[channel + 1 :]
            return WithSerialLine(open_interfaces(kind, others, filters, queue_frames), line, channel)
        except UserError:
            line.close()
            raise
    if kind == SOCKETCAN and not takes_fd(filters):
        return SocketCanBus(names, filters, queue_frames)
    return PythonCanBus(kind, names, filters, queue_frames)


@contextmanager
def locked_interfaces(kind: str, names: tuple[str, ...], filters: tuple[CanFilter, ...]) -> Iterator[Bus]:
    """Buses of a robot, locked for the one process that commands it (see `open_interfaces`).

    Raises:
        UserError: a bus cannot be opened, or another process commands a robot on it.
    """
    with ExitStack() as resources:
        for name, key in _lock_keys(kind, names).items():
            resources.enter_context(locked(f"bus/{key}", f"bus {name} ({kind})"))
        bus = open_interfaces(kind, names, filters)
        resources.callback(bus.close)
        yield bus


def _lock_keys(kind: str, names: tuple[str, ...]) -> dict[str, str]:
    """Keys that identify buses shared between processes, by their names in robot.yaml."""
    if kind == VIRTUAL:  # private to this process
        return {}
    if kind == MULTICAST:
        return {name: f"{MULTICAST_GROUP}:{MULTICAST_PORT + index}" for index, name in enumerate(names)}
    return {name: os.path.realpath(name) if os.path.exists(name) else f"{kind}/{name}" for name in names}
