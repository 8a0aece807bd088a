"""Base class of buses that observe or change the frames of another bus."""

from footfall.deploy.bus import Bus, BusStatistics
from footfall.deploy.frames import Frames


class WrappedBus:
    """Forwards everything; derived classes override methods."""

    def __init__(self, inner: Bus) -> None:
        self._inner = inner

    def send(self, frames: Frames, now_us: int) -> int:
        return self._inner.send(frames, now_us)

    def receive(self, now_us: int) -> list[Frames]:
        return self._inner.receive(now_us)

    def fault(self) -> str:
        return self._inner.fault()

    def statistics(self) -> list[BusStatistics]:
        return self._inner.statistics()

    def close(self) -> None:
        self._inner.close()
