"""Height scans that reach a policy: recent scans of the right grid. Others are noted."""

from unittest.mock import Mock

import numpy as np

from footfall.deploy.height_scan import HeightScans, NoScans, Scanned
from footfall.policies.height_scan import HeightScan

SCAN = HeightScan(max_age_s=0.3)
HEIGHTS = np.linspace(-0.4, 0.0, SCAN.size)


def test_a_scan_counts_until_it_is_too_old_and_a_new_scan_counts_again() -> None:
    """A scan with a time in the future does not count."""
    source = Mock()
    source.newest.return_value = Scanned(1_000_000, HEIGHTS)
    scans = HeightScans(SCAN, source)
    assert HeightScans(SCAN, source).fresh(900_000) is None
    assert scans.fresh(1_000_000) is scans.fresh(1_300_000) is HEIGHTS
    assert scans.notes == []
    assert scans.fresh(1_300_001) is scans.fresh(1_400_000) is None
    assert len(scans.notes) == 1
    source.newest.return_value = Scanned(1_400_000, HEIGHTS)
    assert scans.fresh(1_420_000) is HEIGHTS


def test_a_scan_of_another_grid_and_a_failing_source_are_noted_once() -> None:
    """Neither stops the policy."""
    small, broken = Mock(), Mock()
    small.newest.return_value = Scanned(0, HEIGHTS[:-1])
    broken.newest.side_effect = RuntimeError("the camera is gone")
    rows = ((small, 20_000, (str(SCAN.size), str(SCAN.size - 1))), (broken, 400_000, ("the camera is gone",)))
    for source, step_us, words in rows:
        scans = HeightScans(SCAN, source)
        assert [scans.fresh(step * step_us) for step in range(3)] == [None] * 3
        (note,) = scans.notes
        assert all(word in note for word in words)


def test_a_lasting_silence_is_noted() -> None:
    scans = HeightScans(SCAN, NoScans())
    for now_us, notes in ((5_000_000, 0), (5_400_000, 1)):
        assert scans.fresh(now_us) is None
        assert len(scans.notes) == notes
