"""The simulated robot's height scans, with errors."""

from collections import deque
from collections.abc import Callable

import numpy as np

from footfall.common.rotations import heading
from footfall.deploy.height_scan import Scanned
from footfall.domain_rand.height_scan import NUMBERS, HeightScanErrors, draw_errors, with_errors
from footfall.policies.height_scan import HeightScan
from footfall.terrain.ground import Ground, height_at

Pose = tuple[np.ndarray, np.ndarray]  # of the base: position (3,) m, world, and quaternion (4,)
SEED = 0x5CA9  # combined with the episode's seed, so that other draws do not change


class SimulatedScanner:
    """Scans the ground around the simulated robot at the scan's rate, and delivers each scan after a lag."""

    def __init__(
        self,
        scan: HeightScan,
        errors: HeightScanErrors,
        ground: Ground | None,
        pose: Callable[[], Pose],
        seed: int,
    ) -> None:
        """`ground` None: level ground at height 0."""
        self._scan, self._errors, self._ground, self._pose = scan, errors, ground, pose
        self._rng = np.random.default_rng([seed, SEED])
        self._drawn = draw_errors(errors, self._rng.random(NUMBERS))
        self._first_us: int | None = None
        self._next_us = 0
        self._pending: deque[Scanned] = deque()
        self._newest: Scanned | None = None

    def newest(self, now_us: int) -> Scanned | None:
        """The newest scan that has arrived; takes a new one if it is due."""
        if self._first_us is None:
            self._first_us = self._next_us = now_us
        if now_us >= self._next_us:
            self._next_us = now_us + round(1e6 / self._scan.rate_hz)
            taken_s = (now_us - self._first_us) * 1e-6
            if taken_s < self._drawn.end_s:
                self._pending.append(Scanned(now_us, self._take(taken_s)))
        while self._pending and now_us - self._pending[0].taken_us >= self._drawn.lag_s * 1e6:
            self._newest = self._pending.popleft()
        return self._newest

    def _take(self, taken_s: float) -> np.ndarray:
        position, quaternion = self._pose()
        positions = self._scan.positions(position, heading(quaternion), self._drawn.shift_m)
        ground = np.zeros(len(positions)) if self._ground is None else height_at(self._ground, positions)
        u = self._rng.random((2, len(positions)))
        return with_errors(ground - position[2], self._errors, self._drawn, np.float64(taken_s), u)
