"""How many of the last ticks were left out because the loop was late."""


class SkippedTicks:
    """The share of the last second's ticks that were left out; older ones count less and less."""

    def __init__(self, tick_us: int) -> None:
        self._tick_us, self._share = tick_us, 0.0

    def share(self, elapsed_us: int) -> float:
        """The share, once `elapsed_us` have passed since the tick before."""
        if elapsed_us > self._tick_us or self._share:
            weight = min(elapsed_us * 1e-6, 1.0)
            left_out = (elapsed_us - self._tick_us) / elapsed_us if elapsed_us else 0.0
            self._share += weight * (left_out - self._share)
        return self._share
