"""Leaves out messages that come too often."""

import math


class Throttle:
    """Lets a message pass at most so often. Times are those of the messages."""

    def __init__(self, rate_hz: float) -> None:
        """`rate_hz`: highest rate; infinite lets all pass."""
        self._period_ns = 0 if math.isinf(rate_hz) else round(1e9 / rate_hz)
        self._next_ns = 0

    def due(self, time_ns: int) -> bool:
        """Whether a message of this time passes. The mean rate is kept, not the shortest gap."""
        if time_ns < self._next_ns:
            return False
        late_ns = time_ns - self._next_ns
        self._next_ns = time_ns + self._period_ns - (late_ns if late_ns < self._period_ns else 0)
        return True
