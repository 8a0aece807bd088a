"""A bus that also writes its frames to a run's log."""

from typing import TYPE_CHECKING

from footfall.deploy.bus import Bus
from footfall.deploy.frames import Frames
from footfall.deploy.log_records import Kind
from footfall.deploy.wrapped_bus import WrappedBus

if TYPE_CHECKING:
    from footfall.deploy.log import McapLog


class LoggedBus(WrappedBus):
    """Forwards frames and logs them. A logged frame may have been rejected by a full queue."""

    def __init__(self, bus: Bus, log: "McapLog") -> None:
        super().__init__(bus)
        self._log = log

    def send(self, frames: Frames, now_us: int) -> int:
        refused = super().send(frames, now_us)
        self._log.frames(now_us, Kind.SENT, frames)
        return refused

    def receive(self, now_us: int) -> list[Frames]:
        batches = super().receive(now_us)
        for batch in batches:
            self._log.frames(now_us, Kind.RECEIVED, batch)
        return batches
