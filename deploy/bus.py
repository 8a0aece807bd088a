"""What the control loop sees of its CAN buses, whatever carries the frames."""

from dataclasses import dataclass
from typing import Protocol

from footfall.deploy.frames import Frames

HOST_QUEUE = 10  # frames that a CAN interface queues for sending: the default on Linux
# Taken from one bus in one tick, so that a babbling node cannot stop the loop: more than a wire of 1 Mbit/s
# carries in 100 ms, so that what waits after a pause is taken at once and no reading ages in the queue.
MOST_FRAMES_AT_ONCE = 1024


@dataclass
class BusStatistics:
    """What happened on one bus so far."""

    name: str
    frames_sent: int = 0
    frames_received: int = 0
    frames_refused: int = 0  # the transmit queue was full
    errors: int = 0  # error frames, where the interface tells of them
    load: float | None = None  # share of the time that the wire was busy, where it is known


class Bus(Protocol):
    """All buses of one robot, seen from the controller. Times are whole microseconds of the loop's clock."""

    def send(self, frames: Frames, now_us: int) -> int:
        """Queue frames for transmission; returns how many a full queue refused."""
        ...

    def receive(self, now_us: int) -> list[Frames]:
        """Frames that have arrived since the last call, oldest first."""
        ...

    def fault(self) -> str:
        """Which bus does not work, and why, in one line; empty if all do."""
        ...

    def statistics(self) -> list[BusStatistics]:
        """Figures of each bus."""
        ...

    def close(self) -> None:
        """Let go of the interfaces."""
        ...
