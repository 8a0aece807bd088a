"""Socket pairs between two processes instead of CAN interfaces, for kernels without CAN.

For `deploy.socketcan_bus` one end of a pair behaves like an interface: the same system calls return datagrams
of one frame each, with a time stamp. The kernel's CAN filters and error frames are missing.
"""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

from footfall.deploy import socketcan_bus
from footfall.deploy.drivers.driver import CanFilter

QUEUE_BYTES = 2**22  # or the system's limit: a slow reader must not make a write fail

Ends = dict[str, socket.socket]  # by name of the interface


def socket_pairs(names: tuple[str, ...]) -> tuple[Ends, Ends]:
    """Near and far end of each interface."""
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in names]
    for end in (end for pair in pairs for end in pair):
        end.setsockopt(socket.SOL_SOCKET, socketcan_bus.SO_TIMESTAMPNS, 1)
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, QUEUE_BYTES)
        end.setblocking(False)
    near, far = zip(*pairs, strict=True)
    return dict(zip(names, near, strict=True)), dict(zip(names, far, strict=True))


@contextmanager
def in_place_of_interfaces(ends: Ends) -> Iterator[None]:
    """While the context is open, SocketCAN buses use these ends, each once."""
    open_kernel_socket = socketcan_bus.open_socket

    def open_end(name: str, filters: tuple[CanFilter, ...]) -> socket.socket:
        return ends[name] if name in ends else open_kernel_socket(name, filters)

    socketcan_bus.open_socket = open_end
    try:
        yield
    finally:
        socketcan_bus.open_socket = open_kernel_socket
