"""Interface of the control loop to CAN buses, independent of the transport."""

from dataclasses import dataclass
from typing import Protocol

from footfall.deploy.frames import Frames

HOST_QUEUE = 10  # frames in the transmit queue of a CAN interface: default on Linux
# Limit of frames read from one bus per tick, so that a babbling node cannot stop the loop. A bus at 1 Mbit/s
# carries fewer in 100 ms: after a pause all waiting frames are read at once, and no reading ages in the
# queue.
MAX_FRAMES_PER_TICK = 1024


@dataclass
class BusStatistics:
    """Counts of one bus so far."""

    name: str
    frames_sent: int = 0
    frames_received: int = 0
    frames_refused: int = 0  # rejected, because the transmit queue was full
    errors: int = 0  # error frames, if the interface reports them
    load: float | None = None  # busy share of the time; None if unknown


class Bus(Protocol):
    """All buses of one robot, from the controller's side. Times are integer microseconds of the loop's
    clock."""

    def send(self, frames: Frames, now_us: int) -> int:
        """Queue frames for transmission; returns the number rejected by a full queue."""
        ...

    def receive(self, now_us: int) -> list[Frames]:
        """Frames received since the last call, oldest first."""
        ...

    def fault(self) -> str:
        """First failing bus with the reason, in one line; empty if all work."""
        ...

    def statistics(self) -> list[BusStatistics]:
        """Counts of each bus."""
        ...

    def close(self) -> None:
        """Close the interfaces."""
        ...
