"""Things that one process at a time may use, such as a CAN bus or a log.

A process that holds a thing listens on a socket in Linux' abstract namespace with the thing's name. The
kernel closes it when the process ends, however that happens, and tells others which process it is. Such names
are seen within one network namespace, as CAN interfaces are.
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
LONGEST_READABLE = 80  # bytes of a name; the kernel takes 107


@contextmanager
def held(name: str, what: str) -> Iterator[None]:
    """Hold a thing for as long as the context lasts. On systems other than Linux nothing is held.

    Args:
        name: of the thing, the same in every process.
        what: the thing in words, for the message.

    Raises:
        UserError: a process holds it already; the message has its id.
    """
    if sys.platform != "linux":
        yield
        return
    address = _address(name)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as ours:
        try:
            ours.bind(address)
        except OSError:
            raise UserError(f"{what} is in use by {_holder(address)}: end it first") from None
        ours.listen(8)
        yield


def _address(name: str) -> str:
    if len(name.encode()) > LONGEST_READABLE:
        name = hashlib.sha256(name.encode()).hexdigest()
    return f"\0{NAMESPACE}/{name}"


def _holder(address: str) -> str:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.settimeout(1.0)
        try:
            asking.connect(address)
            told = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, CREDENTIALS.size)
        except OSError:
            return "another process"
    process, *_ = CREDENTIALS.unpack(told)
    if not process:  # in another container
        return "another process"
    return f"this process ({process})" if process == os.getpid() else f"process {process}"
