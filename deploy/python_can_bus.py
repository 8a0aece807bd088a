"""CAN interfaces through python-can: SocketCAN on a robot, `virtual` and `udp_multicast` without hardware."""

import logging
import time
from typing import Any

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.bus import HOST_QUEUE, BusStatistics
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import Frames, frame_bits

MULTICAST = "udp_multicast"
MULTICAST_GROUP = "239.74.163.2"
MULTICAST_PORT = (
    43113  # of the first bus; each further bus has the next one, since ports alone keep them apart
)
MOST_FRAMES_AT_ONCE = 256  # taken from one bus in one tick, so that a babbling node cannot stop the loop


def interfaces() -> list[str]:
    """Names of the interfaces that python-can knows."""
    import can

    return sorted(can.VALID_INTERFACES)


class PythonCanBus:
    """All buses of a robot on one kind of python-can interface.

    Writes are paced: a frame waits while as many frames as the transmit queue holds are still on their way
    out, which keeps SocketCAN from answering ENOBUFS. A frame that the interface refuses all the same is
    counted and lost, and an interface that fails goes silent; the supervisor acts on both.
    """

    def __init__(
        self,
        interface: str,
        names: tuple[str, ...],
        filters: tuple[CanFilter, ...],
        queue_frames: int = HOST_QUEUE,
    ) -> None:
        """Open the interfaces.

        Args:
            interface: python-can's name of the kind of interface.
            names: of the buses.
            filters: which frames to receive.
            queue_frames: how many frames an interface queues for sending.

        Raises:
            UserError: there is no such interface, or a bus of it cannot be opened.
        """
        import can

        if interface not in can.VALID_INTERFACES:
            raise UserError(f"no bus '{interface}': give one of sim, {', '.join(interfaces())}")
        self._can = can
        self._queue_s = (queue_frames - 1) * frame_bits(8) * 1e-6
        self._free_at = [0.0] * len(names)
        self._statistics = [BusStatistics(name) for name in names]
        self._buses: list[Any] = []
        logging.getLogger("can").setLevel(logging.CRITICAL)  # failures are reported in our own words
        for index, name in enumerate(names):
            try:
                self._buses.append(_open(can, interface, index, name, filters))
            except (OSError, can.CanError, ImportError, ValueError, TypeError) as error:
                self.close()
                raise UserError(
                    f"cannot open bus '{name}' on {interface}: {' '.join(str(error).split())}"
                ) from None

    def send(self, frames: Frames, now_us: int) -> int:
        """Write frames, paced; returns how many the interfaces refused."""
        refused = 0
        for channel, identifier, data, length in zip(
            frames.channel.tolist(), frames.id.tolist(), frames.data, frames.length.tolist(), strict=True
        ):
            self._pace(channel, length)
            message = self._can.Message(
                arbitration_id=identifier,
                is_extended_id=False,
                data=data[:length].tobytes(),
                check=False,
            )
            try:
                self._buses[channel].send(message)
                self._statistics[channel].frames_sent += 1
            except (OSError, self._can.CanError):
                self._statistics[channel].frames_refused += 1
                refused += 1
        return refused

    def receive(self, now_us: int) -> list[Frames]:
        """Frames that wait on any bus, in one batch."""
        rows: list[tuple[int, int, bytes]] = []
        for channel, bus in enumerate(self._buses):
            for _ in range(MOST_FRAMES_AT_ONCE):
                try:
                    message = bus.recv(timeout=0)
                except (OSError, self._can.CanError):
                    break
                if message is None:
                    break
                if _is_plain(message):
                    rows.append((channel, message.arbitration_id, bytes(message.data)))
                    self._statistics[channel].frames_received += 1
        if not rows:
            return []
        data = b"".join(content.ljust(8, b"\0") for _, _, content in rows)
        return [
            Frames(
                np.array([channel for channel, _, _ in rows]),
                np.array([identifier for _, identifier, _ in rows]),
                np.frombuffer(data, dtype=np.uint8).reshape(-1, 8),
                np.array([len(content) for _, _, content in rows]),
            )
        ]

    def statistics(self) -> list[BusStatistics]:
        return self._statistics

    def close(self) -> None:
        for bus in self._buses:
            bus.shutdown()
        self._buses = []

    def _pace(self, channel: int, length: int) -> None:
        now = time.monotonic()
        backlog = self._free_at[channel] - now
        if backlog > self._queue_s:
            time.sleep(backlog - self._queue_s)
        self._free_at[channel] = max(self._free_at[channel], now) + frame_bits(length) * 1e-6


def _is_plain(message: Any) -> bool:
    special = message.is_error_frame or message.is_remote_frame or message.is_extended_id
    return not special and len(message.data) <= 8


def _open(can: Any, interface: str, index: int, name: str, filters: tuple[CanFilter, ...]) -> Any:
    if interface == MULTICAST:
        return can.Bus(
            interface=interface,
            channel=MULTICAST_GROUP,
            port=MULTICAST_PORT + index,
            fd=False,
            can_filters=list(filters),
        )
    return can.Bus(interface=interface, channel=name, can_filters=list(filters))
