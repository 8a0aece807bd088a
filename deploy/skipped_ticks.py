"""Share of the last ticks that were skipped because the loop was late."""


class SkippedTicks:
    """Share of skipped ticks in the last second; older ones count exponentially less."""

    def __init__(self, tick_us: int) -> None:
        self._tick_us, self._share = tick_us, 0.0

    def share(self, elapsed_us: int) -> float:
        """Update with `elapsed_us`, the time since the previous tick; returns the share."""
        if elapsed_us > self._tick_us or self._share:
            weight = min(elapsed_us * 1e-6, 1.0)
            skipped = (elapsed_us - self._tick_us) / elapsed_us if elapsed_us else 0.0
            self._share += weight * (skipped - self._share)
        return self._share
