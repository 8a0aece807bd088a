"""Limits the rate of messages."""

import math


class Throttle:
    """Lets messages pass at a maximum rate. Times are those of the messages."""

    def __init__(self, rate_hz: float) -> None:
        """`rate_hz`: maximum rate; infinite lets all messages pass."""
        self._period_ns = 0 if math.isinf(rate_hz) else round(1e9 / rate_hz)
        self._next_ns = 0

    def due(self, time_ns: int) -> bool:
        """Whether a message of this time passes. Limits the mean rate, not the interval."""
        if time_ns < self._next_ns:
            return False
        late_ns = time_ns - self._next_ns
        self._next_ns = time_ns + self._period_ns - (late_ns if late_ns < self._period_ns else 0)
        return True
