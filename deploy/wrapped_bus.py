"""A bus around another one, for those that look at its frames or change them."""

from footfall.deploy.bus import Bus, BusStatistics
from footfall.deploy.frames import Frames


class WrappedBus:
    """Passes everything on; a derived class overrides what it adds to."""

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
