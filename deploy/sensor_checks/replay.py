"""Detects IMU readings that equal earlier ones, in the same order, to the last digit."""

from footfall.deploy.drivers.imu import Inertial

LEAST_BACK = 5  # readings: a base at rest may repeat the last few of them
KEPT = 512  # readings, two seconds of them


class ReplayFinder:
    """Looks up each reading among the latest `KEPT`."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all readings."""
        self.replayed_s = 0.0  # how long readings have equalled those of a fixed time before
        self._places: dict[tuple[float, ...], int] = {}  # number of the latest reading with these values
        self._number, self._back, self._since_us = 0, 0, 0

    def look(self, now_us: int, inertial: Inertial) -> None:
        """Take in a reading that arrived at this time."""
        key = tuple(inertial.quaternion)  # the reading with the finest resolution
        number, places = self._number, self._places
        self._number = number + 1
        before = places.pop(key, None)  # and insert it again, so that the oldest key stays first
        places[key] = number
        if before is None:
            self._back, self.replayed_s = 0, 0.0
            if len(places) > KEPT:
                places.pop(next(iter(places)))
            return
        back = number - before
        if back < LEAST_BACK or back != self._back:
            self._back, self._since_us = back, now_us
        self.replayed_s = 1e-6 * (now_us - self._since_us) if back >= LEAST_BACK else 0.0
