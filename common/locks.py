"""Locks on resources that one process at a time may use, such as a CAN bus or a log.

The holder listens on a socket with the lock's name in Linux' abstract namespace. The kernel closes the socket
when the process ends, even if it is killed, and tells other processes the holder's process id. Like CAN
interfaces, such names are visible within one network namespace.
"""

import hashlib
import os
import socket
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from footfall.common.errors import UserError

NAMESPACE = "footfall"
CREDENTIALS = struct.Struct("3i")  # struct ucred: process, user, group
MAX_NAME_BYTES = 80  # bytes of a name; the kernel accepts 107


@contextmanager
def locked(name: str, what: str) -> Iterator[None]:
    """Hold a lock while the context lasts. Only Linux has locks; elsewhere this does nothing.

    Args:
        name: name of the lock, the same in every process.
        what: name of the locked resource, for the message.

    Raises:
        UserError: a process holds the lock; the message has the process id.
    """
    if sys.platform != "linux":
        yield
        return
    address = _address(name)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as lock:
        try:
            lock.bind(address)
        except OSError:
            raise UserError(f"{what} is in use by {_holder(address)}: end it first") from None
        lock.listen(socket.SOMAXCONN)  # refused processes stay in this queue: none is accepted
        yield


def _address(name: str) -> str:
    if len(name.encode()) > MAX_NAME_BYTES:
        name = hashlib.sha256(name.encode()).hexdigest()
    return f"\0{NAMESPACE}/{name}"


def _holder(address: str) -> str:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(1.0)
        try:
            probe.connect(address)
            credentials = probe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
        except OSError:
            return "another process"
    process, *_ = CREDENTIALS.unpack(credentials)
    if not process:  # in another container
        return "another process"
    return f"this process ({process})" if process == os.getpid() else f"process {process}"
