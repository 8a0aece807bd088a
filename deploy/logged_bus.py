"""A bus whose frames go to a run's log."""

from typing import TYPE_CHECKING

from footfall.deploy.bus import Bus, BusStatistics
from footfall.deploy.frames import Frames
from footfall.deploy.log_records import Kind

if TYPE_CHECKING:
    from footfall.deploy.log import McapLog


class LoggedBus:
    """Passes frames on, and logs them. A logged frame was handed over: a full queue may have refused it."""

    def __init__(self, bus: Bus, log: "McapLog") -> None:
        self._bus, self._log = bus, log

    def send(self, frames: Frames, now_us: int) -> int:
        refused = self._bus.send(frames, now_us)
        self._log.frames(now_us, Kind.SENT, frames)
        return refused

    def receive(self, now_us: int) -> list[Frames]:
        batches = self._bus.receive(now_us)
        for batch in batches:
            self._log.frames(now_us, Kind.RECEIVED, batch)
        return batches

    def fault(self) -> str:
        return self._bus.fault()

    def statistics(self) -> list[BusStatistics]:
        return self._bus.statistics()

    def close(self) -> None:
        self._bus.close()
