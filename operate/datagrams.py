"""A UDP socket whose datagrams are answered in a separate thread."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from footfall.common.errors import UserError

WAIT_S = 0.2  # for a datagram, until the thread looks whether the context has ended
JOIN_S = 1.0  # for the thread's end


@contextmanager
def answered_datagrams(
    address: tuple[str, int], max_bytes: int, answer: Callable[[bytes], bytes], option: str
) -> Iterator[int]:
    """Answer datagrams while the context is open; yields the port.

    Args:
        address: host and port to listen on; port 0 chooses a free one.
        max_bytes: maximum size of a datagram, bytes. A longer one is truncated to `max_bytes` + 1.
        answer: returns the reply to a datagram; empty for none.
        option: name of the command-line option, for the message.

    Raises:
        UserError: the address cannot be used.
    """
    ended = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        try:
            listener.bind(address)
        except OSError as error:
            raise UserError(f"{option}: {address[0]}:{address[1]}: {error.strerror or error}") from None
        listener.settimeout(WAIT_S)

        def listen() -> None:
            while not ended.is_set():
                with suppress(OSError):  # no datagram, or the sender is gone
                    datagram, sender = listener.recvfrom(max_bytes + 1)
                    if reply := answer(datagram):
                        listener.sendto(reply, sender)

        thread = threading.Thread(target=listen, name=option, daemon=True)
        thread.start()
        try:
            yield listener.getsockname()[1]
        finally:
            ended.set()
            thread.join(JOIN_S)
