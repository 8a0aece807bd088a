"""CAN interfaces by python-can: commercial adapters, and `virtual` and `udp_multicast` without hardware."""

import logging
import operator
import time
from collections.abc import Iterator
from contextlib import suppress
from functools import lru_cache
from typing import Any

import numpy as np

from footfall.common.errors import UserError
from footfall.common.installation import install_command
from footfall.deploy import can_errors
from footfall.deploy.bus import HOST_QUEUE, MAX_FRAMES_PER_TICK, BusStatistics
from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import EXTENDED, FD, ID_MASK, MAX_FD_BYTES, Frames, bits_of, takes_fd
from footfall.deploy.interface_time import Arrivals, Pacing

MULTICAST = "udp_multicast"
MULTICAST_GROUP = "239.74.163.2"
MULTICAST_PORT = 43113  # port of the first bus; each further bus has the next port
MAX_FAILURES_PER_TICK = 16  # for one bus: an invalid datagram, or an interface that is down
OVER_SERIAL_PORTS = ("robotell", "seeedstudio", "serial", "slcan")
SERIAL_LIBRARY = "pyserial"  # required for these interfaces, and not installed with python-can
STATE_EVERY_S = 0.1  # between two queries of a controller's state


def interfaces() -> list[str]:
    """Names of python-can's interfaces."""
    import can

    return sorted(can.VALID_INTERFACES)


class PythonCanBus:
    """All buses of a robot on one kind of python-can interface.

    Writes are paced (`Pacing`). A frame rejected by the interface is counted and lost, and a failing
    interface becomes silent; the supervisor reacts to both.
    """

    def __init__(
        self,
        interface: str,
        names: tuple[str, ...],
        filters: tuple[CanFilter, ...],
        queue_frames: int = HOST_QUEUE,
    ) -> None:
        """Open the interfaces (see `deploy.interfaces.open_interfaces`).

        Raises:
            UserError: there is no such interface, or one of its buses cannot be opened.
        """
        import can

        if interface not in can.VALID_INTERFACES:
            if interface in names:
                raise UserError(
                    f"--bus is the kind of interface, such as socketcan; '{interface}' is the name of a bus"
                )
            raise UserError(
                f"no bus '{interface}': give one of {', '.join(interfaces())}; deploy also has sim"
            )
        self._can = can
        self._pacing = Pacing(len(names), queue_frames)
        self._arrivals = Arrivals()
        self._statistics = [BusStatistics(name) for name in names]
        accepted = [(f["can_id"] | f["extended"] * EXTENDED, f["can_mask"] | EXTENDED) for f in filters]

        @lru_cache(maxsize=MAX_FRAMES_PER_TICK)
        def passes(identifier: int) -> bool:
            return any((identifier & ~FD ^ each) & mask == 0 for each, mask in accepted)

        self._passes = passes
        self._faults = [""] * len(names)
        self._state_read_s = time.monotonic()
        self._buses: list[Any] = []
        logging.getLogger("can").setLevel(logging.CRITICAL)  # failures are reported by this module
        for index, name in enumerate(names):
            try:
                self._buses.append(_open(can, interface, index, name, takes_fd(filters)))
            except (OSError, can.CanError, ImportError, ValueError, TypeError) as error:
                self.close()
                why = " ".join(str(error).split())
                if interface in OVER_SERIAL_PORTS and isinstance(error, NotImplementedError):
                    why += f": {install_command(SERIAL_LIBRARY)}"
                raise UserError(f"cannot open bus '{name}' on {interface}: {why}") from None

    def send(self, frames: Frames, now_us: int) -> int:
        """Write frames, paced; returns the number rejected by the interfaces."""
        refused = 0
        for channel, identifier, data, length, bits in zip(
            frames.channel.tolist(),
            frames.id.tolist(),
            frames.data,
            frames.length.tolist(),
            bits_of(frames).tolist(),
            strict=True,
        ):
            self._pacing.wait(channel, bits)
            message = self._can.Message(
                arbitration_id=identifier & ID_MASK,
                is_extended_id=bool(identifier & EXTENDED),
                is_fd=bool(identifier & FD),
                bitrate_switch=bool(identifier & FD),
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
        """Waiting frames of all buses that pass the filters, in one batch.

        All waiting frames are read, even foreign ones: a frame left in the queue would delay later ones.
        """
        rows: list[tuple[int, int, bytes, float]] = []
        for channel, bus in enumerate(self._buses):
            before = len(rows)
            rows.extend((channel, *frame) for frame in self._waiting(channel, bus))
            self._statistics[channel].frames_received += len(rows) - before
        time_us = self._arrivals.times_us(np.array([stamp for *_, stamp in rows]), now_us)
        if not rows:
            return []
        channels, identifiers, contents, _ = zip(*rows, strict=True)
        width = 8 if max(map(len, contents)) <= 8 else MAX_FD_BYTES
        return [
            Frames(
                np.array(channels),
                np.array(identifiers),
                np.frombuffer(b"".join(c.ljust(width, b"\0") for c in contents), np.uint8).reshape(-1, width),
                np.array([len(content) for content in contents]),
                time_us,
            )
        ]

    def fault(self) -> str:
        now_s = time.monotonic()
        if now_s - self._state_read_s >= STATE_EVERY_S:
            self._state_read_s = now_s
            for channel, bus in enumerate(self._buses):
                with suppress(Exception):  # not every interface reports its state
                    self._faults[channel] = self._faults[channel] or can_errors.meaning_of_state(
                        bus.state.name
                    )
        for statistics, fault in zip(self._statistics, self._faults, strict=True):
            if fault:
                return f"bus {statistics.name} {fault}"
        return ""

    def _waiting(self, channel: int, bus: Any) -> Iterator[tuple[int, bytes, float]]:
        """Identifier, bytes and time stamp of each waiting frame of one bus that passes the filters."""
        failures = 0
        for _ in range(MAX_FRAMES_PER_TICK):
            try:
                message = bus.recv(timeout=0)
                if message is None:
                    return
                frame = None
                if message.is_error_frame:
                    self._note_error(channel, message)
                elif message.is_rx:  # not the echo of a sent frame
                    frame = _plain_frame(message)
            except Exception:  # a failing interface, or a foreign datagram
                failures += 1
                if failures >= MAX_FAILURES_PER_TICK:
                    return
                continue
            if frame is not None and self._passes(frame[0]):
                yield frame

    def _note_error(self, channel: int, message: Any) -> None:
        self._statistics[channel].errors += 1
        if not self._faults[channel]:  # the first error frame, if its identifier is as in SocketCAN
            self._faults[channel] = can_errors.meaning(message.arbitration_id, bytes(message.data))

    def statistics(self) -> list[BusStatistics]:
        return self._statistics

    def close(self) -> None:
        for bus in self._buses:
            bus.shutdown()
        self._buses = []


def _plain_frame(message: Any) -> tuple[int, bytes, float] | None:
    """Identifier, bytes and Unix arrival time of a data frame; None for anything else.

    Raises:
        TypeError: it is not a frame.
    """
    if message.is_remote_frame:
        return None
    data = bytes(message.data)
    identifier = operator.index(message.arbitration_id) | bool(message.is_extended_id) * EXTENDED
    fd = bool(message.is_fd)
    if len(data) > (MAX_FD_BYTES if fd else 8):
        return None
    return identifier | fd * FD, data, float(message.timestamp)


def _open(can: Any, interface: str, index: int, name: str, fd: bool) -> Any:
    """Open one bus, for CAN FD if `fd`.

    It has no python-can filters: with them, `recv` returns None for a foreign frame, too.
    """
    if interface == MULTICAST:
        return can.Bus(interface=interface, channel=MULTICAST_GROUP, port=MULTICAST_PORT + index, fd=fd)
    return can.Bus(interface=interface, channel=name, **({"fd": True} if fd else {}))
