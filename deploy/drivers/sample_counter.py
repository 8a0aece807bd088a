"""Order of a sensor's samples, by their counter."""

COUNTER_VALUES = 0x10000  # values of a 16-bit counter before it wraps around
MAX_STEP = 32  # samples: a larger step may be a flipped bit


class SampleCounter:
    """Distinguishes new samples from repeated and older ones.

    A step larger than `MAX_STEP` is accepted once the next sample confirms it. After a step forward the
    sensor was silent; after a step backward it has restarted, or its frames are replayed.
    """

    def __init__(self) -> None:
        self._latest = self._far = -1  # counter of the latest sample, and of the last one far from it
        self.older = 0  # older samples so far, plus the samples by which the counter went back

    def is_new(self, counter: int) -> bool | None:
        """True for a new sample, False for the latest one repeated, None for one to ignore."""
        step = 1 if self._latest < 0 else (counter - self._latest) % COUNTER_VALUES
        if step == 0:
            return False
        if step <= MAX_STEP:
            self._latest = counter
            return True
        if step >= COUNTER_VALUES - MAX_STEP:
            self.older += 1
            return None
        if self._far < 0 or not 0 < (counter - self._far) % COUNTER_VALUES <= MAX_STEP:
            self._far = counter
            return None
        self.older += COUNTER_VALUES - step if step > COUNTER_VALUES // 2 else 0
        self._latest, self._far = counter, -1
        return True
