"""Opens a robot's CAN interfaces by the name of their kind."""

from footfall.deploy.bus import HOST_QUEUE, Bus
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.python_can_bus import PythonCanBus
from footfall.deploy.socketcan_bus import SOCKETCAN, SocketCanBus


def open_interfaces(
    kind: str, names: tuple[str, ...], filters: tuple[CanFilter, ...], queue_frames: int = HOST_QUEUE
) -> Bus:
    """Open all buses of a robot.

    Args:
        kind: `socketcan` (Linux), or another interface of python-can.
        names: of the buses.
        filters: a frame is received if it passes one of them.
        queue_frames: length of an interface's transmit queue.

    Raises:
        UserError: there is no such kind of interface, or a bus of it cannot be opened.
    """
    if kind == SOCKETCAN:
        return SocketCanBus(names, filters, queue_frames)
    return PythonCanBus(kind, names, filters, queue_frames)
