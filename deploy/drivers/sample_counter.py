"""The order of an IMU's samples, by the counter that each of them carries."""

COUNTS = 0x10000  # of a counter of 16 bits, before it begins anew
NEAR = 32  # samples: a step that is longer than that may be a flipped bit


class SampleCounter:
    """Distinguishes new samples from repeated and from older ones.

    A longer step forward, as after a silence, and a longer step back, as of a device that has restarted or of
    frames that are replayed, counts once the next sample confirms it.
    """

    def __init__(self) -> None:
        self._latest = self._far = -1  # the latest sample, and the last one that was far from it
        self.older = 0  # samples so far that were older than the latest, and by how many the counter ran back

    def is_new(self, counter: int) -> bool | None:
        """Whether a sample is new; None for one that is to be left out."""
        step = 1 if self._latest < 0 else (counter - self._latest) % COUNTS
        if step == 0:
            return False
        if step <= NEAR:
            self._latest = counter
            return True
        if step >= COUNTS - NEAR:
            self.older += 1
            return None
        if self._far < 0 or not 0 < (counter - self._far) % COUNTS <= NEAR:
            self._far = counter
            return None
        self.older += COUNTS - step if step > COUNTS // 2 else 0
        self._latest, self._far = counter, -1
        return True
