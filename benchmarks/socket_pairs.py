"""Sockets between two processes in place of CAN interfaces, for kernels that have none.

`deploy.socketcan_bus` finds at an end of a pair what it finds at an interface, by the same system calls:
datagrams of one frame each, with the time at which they came. What the kernel's CAN stack does beyond that,
filters and error frames among it, is left out.
"""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from footfall.deploy import socketcan_bus
from footfall.deploy.drivers.driver import CanFilter

QUEUE_BYTES = 2**22  # as far as the system lets us: no interface refuses a frame because its reader is slow

Ends = dict[str, socket.socket]  # by the interface's name


def socket_pairs(names: tuple[str, ...]) -> tuple[Ends, Ends]:
    """The near and the far end of each interface."""
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in names]
    for end in (end for pair in pairs for end in pair):
        end.setsockopt(socket.SOL_SOCKET, socketcan_bus.SO_TIMESTAMPNS, 1)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, QUEUE_BYTES)
        end.setblocking(False)
    near, far = zip(*pairs, strict=True)
    return dict(zip(names, near, strict=True)), dict(zip(names, far, strict=True))


@contextmanager
def in_place_of_interfaces(ends: Ends) -> Iterator[None]:
    """Buses on SocketCAN that are opened in this context get these ends, once each."""
    of_the_kernel = socketcan_bus.open_socket

    def open_end(name: str, filters: tuple[CanFilter, ...]) -> socket.socket:
        return ends[name] if name in ends else of_the_kernel(name, filters)

    socketcan_bus.open_socket = open_end
    try:
        yield
    finally:
        socketcan_bus.open_socket = of_the_kernel
