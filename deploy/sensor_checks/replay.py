"""Detection of IMU readings that exactly equal earlier ones, in the same order."""

from footfall.deploy.drivers.imu import Inertial

MIN_DELAY = 5  # readings: a base at rest may repeat the last few readings
HISTORY_READINGS = 512  # number of stored readings, two seconds


class ReplayFinder:
    """Compares each reading with the latest `HISTORY_READINGS` ones."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Clear all readings."""
        self.replayed_s = 0.0  # how long readings have equalled those of a constant time before
        self._index_of: dict[tuple[float, ...], int] = {}  # number of the latest reading with these values
        self._number, self._delay, self._since_us = 0, 0, 0

    def update(self, now_us: int, inertial: Inertial) -> None:
        """Compare a reading that arrived at this time."""
        key = tuple(inertial.quaternion)  # the part with the finest resolution
        number, index_of = self._number, self._index_of
        self._number = number + 1
        previous = index_of.pop(key, None)  # and insert it again, so that the oldest key stays first
        index_of[key] = number
        if previous is None:
            self._delay, self.replayed_s = 0, 0.0
            if len(index_of) > HISTORY_READINGS:
                index_of.pop(next(iter(index_of)))
            return
        delay = number - previous
        if delay < MIN_DELAY or delay != self._delay:
            self._delay, self._since_us = delay, now_us
        self.replayed_s = 1e-6 * (now_us - self._since_us) if delay >= MIN_DELAY else 0.0
