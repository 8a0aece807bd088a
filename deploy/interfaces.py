"""A robot's CAN interfaces by the name of their kind."""

from footfall.deploy.bus import HOST_QUEUE, Bus
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.python_can_bus import PythonCanBus
from footfall.deploy.socketcan_bus import SOCKETCAN, SocketCanBus


def open_interfaces(
    kind: str, names: tuple[str, ...], filters: tuple[CanFilter, ...], queue_frames: int = HOST_QUEUE
) -> Bus:
    """Open all buses of a robot.

    Args:
        kind: `socketcan`, which is Linux's own, or whatever else python-can knows.
        names: of the buses.
        filters: which frames to receive: those that pass any of them.
        queue_frames: how many frames an interface queues for sending.

    Raises:
        UserError: there is no such kind of interface, or a bus of it cannot be opened.
    """
    if kind == SOCKETCAN:
        return SocketCanBus(names, filters, queue_frames)
    return PythonCanBus(kind, names, filters, queue_frames)
