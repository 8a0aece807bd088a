"""Height scans that reach a policy: recent scans of the right grid. Others are noted."""

import numpy as np

from footfall.deploy.height_scan import HeightScans, NoScans, Scanned
from footfall.policies.height_scan import HeightScan

SCAN = HeightScan(max_age_s=0.3)
HEIGHTS = np.linspace(-0.4, 0.0, SCAN.size)


class Source:
    """Returns its given scan."""

    def __init__(self, scanned: Scanned | None) -> None:
        self.scanned = scanned

    def newest(self, now_us: int) -> Scanned | None:
        return self.scanned


def test_a_scan_counts_until_it_is_too_old_and_a_new_scan_counts_again() -> None:
    """A scan with a time in the future does not count."""
    source = Source(Scanned(1_000_000, HEIGHTS))
    scans = HeightScans(SCAN, source)
    assert HeightScans(SCAN, source).fresh(900_000) is None
    assert scans.fresh(1_000_000) is scans.fresh(1_300_000) is HEIGHTS
    assert scans.notes == []
    assert scans.fresh(1_300_001) is scans.fresh(1_400_000) is None
    assert len(scans.notes) == 1
    source.scanned = Scanned(1_400_000, HEIGHTS)
    assert scans.fresh(1_420_000) is HEIGHTS


def test_a_scan_of_another_grid_is_ignored_and_noted_once() -> None:
    scans = HeightScans(SCAN, Source(Scanned(0, HEIGHTS[:-1])))
    assert [scans.fresh(now_us) for now_us in (0, 20_000, 40_000)] == [None] * 3
    (note,) = scans.notes
    assert str(SCAN.size) in note
    assert str(SCAN.size - 1) in note


def test_a_lasting_silence_is_noted() -> None:
    scans = HeightScans(SCAN, NoScans())
    assert scans.fresh(5_000_000) is None
    assert scans.notes == []
    assert scans.fresh(5_400_000) is None
    assert len(scans.notes) == 1


def test_a_source_that_fails_does_not_stop_the_policy() -> None:
    class Broken:
        def newest(self, now_us: int) -> Scanned | None:
            raise RuntimeError("the camera is gone")

    scans = HeightScans(SCAN, Broken())
    assert [scans.fresh(now_us) for now_us in (0, 400_000, 800_000)] == [None] * 3
    (note,) = scans.notes
    assert "the camera is gone" in note
