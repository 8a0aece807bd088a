"""What the control loop sees of its CAN buses, whatever carries the frames."""

from dataclasses import dataclass
from typing import Protocol

from footfall.deploy.frames import Frames

HOST_QUEUE = 10  # frames that a CAN interface queues for sending: the default on Linux


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
