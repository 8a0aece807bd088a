"""CAN buses as the control loop uses them, whatever carries the frames."""

from dataclasses import dataclass
from typing import Protocol

from footfall.deploy.frames import Frames

HOST_QUEUE = 10  # frames that a CAN interface queues for sending: the default on Linux
# Most frames read from one bus in one tick: a babbling node cannot stop the loop. A wire of 1 Mbit/s carries
# fewer in 100 ms: after a pause all waiting frames are read at once, and no reading ages in the queue.
MOST_FRAMES_AT_ONCE = 1024


@dataclass
class BusStatistics:
    """Counts of one bus so far."""

    name: str
    frames_sent: int = 0
    frames_received: int = 0
    frames_refused: int = 0  # the transmit queue was full
    errors: int = 0  # error frames, where the interface reports them
    load: float | None = None  # busy share of the time; None where unknown


class Bus(Protocol):
    """All buses of one robot, seen from the controller. Times are whole microseconds of the loop's clock."""

    def send(self, frames: Frames, now_us: int) -> int:
        """Queue frames for transmission; returns the number that a full queue refused."""
        ...

    def receive(self, now_us: int) -> list[Frames]:
        """Frames that have arrived since the last call, oldest first."""
        ...

    def fault(self) -> str:
        """First bus that fails, and why, in one line; empty if all work."""
        ...

    def statistics(self) -> list[BusStatistics]:
        """Counts of each bus."""
        ...

    def close(self) -> None:
        """Close the interfaces."""
        ...
