"""Height scans for the policies of a run: the newest one while it is recent."""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from footfall.common.outside import one_line
from footfall.policies.height_scan import HeightScan, common_height_scan
from footfall.policies.policy import Policy

NONE_YET = "no height scan has arrived: the policy walks without one"
LOST = "no height scan has arrived for {:g} s: the policy walks without one until the next scan"
WRONG_SIZE = "a height scan has {} heights, the policy needs {}: it is ignored"
FAILED = "the source of height scans failed, the policy walks without them: {}"


class Scanned(NamedTuple):
    """A height scan with its time."""

    taken_us: int  # time of the scan, by the loop's clock
    heights: np.ndarray  # (points,) m above the base's origin, in the order of `HeightScan`; NaN if unknown


class HeightScanSource(Protocol):
    """Source of height scans."""

    def newest(self, now_us: int) -> Scanned | None:
        """Newest scan that has arrived; None before the first one. Must not block."""


class NoScans:
    """Source for a robot without height scans."""

    def newest(self, now_us: int) -> None:
        """None at any time."""


class HeightScans:
    """Height scans for policies, checked for size and age."""

    def __init__(self, scan: HeightScan, source: HeightScanSource) -> None:
        self._scan, self._source = scan, source
        self._max_age_us = scan.max_age_s * 1e6
        self._start_us: int | None = None
        self.notes: list[str] = []  # without repetition

    def fresh(self, now_us: int) -> np.ndarray | None:
        """Heights of the newest scan; None if there is none, it is too old, or from another grid."""
        if self._start_us is None:
            self._start_us = now_us
        try:
            scanned = self._source.newest(now_us)
            problem = self._problem(scanned, now_us)
        except Exception as error:  # of any type: the policy can walk without scans
            scanned, problem = None, FAILED.format(one_line(error))
        if scanned is not None and not problem:
            return scanned.heights
        starting = now_us - self._start_us <= self._max_age_us
        if problem not in self.notes and not (scanned is None and starting):
            self.notes.append(problem)
        return None

    def _problem(self, scanned: Scanned | None, now_us: int) -> str:
        """Why a scan cannot be used; empty if it can."""
        if scanned is None:
            return NONE_YET
        if scanned.heights.shape != (self._scan.size,):
            return WRONG_SIZE.format(scanned.heights.size, self._scan.size)
        recent = 0 <= now_us - scanned.taken_us <= self._max_age_us
        return "" if recent else LOST.format(self._scan.max_age_s)


def height_scans_of(policies: Sequence[Policy], source: HeightScanSource | None) -> HeightScans | None:
    """Height scans for the policies of one run; None if no policy uses them.

    Raises:
        UserError: two policies use different scans.
    """
    scan = common_height_scan([policy.contract for policy in policies])
    return None if scan is None else HeightScans(scan, source or NoScans())
