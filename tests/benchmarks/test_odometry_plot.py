"""Plot of the odometry benchmark: curves computed by hand, and a complete drawing."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from odometry_plot import STEP_M, drift_over_distance, plot


def walk(distance_m: float, error_m: float, **more: Any) -> dict[str, Any]:
    """A walk straight ahead, sampled three times, whose error to the left grows with the distance."""
    rows = [
        {"true": [x, 0.0, 0.3], "estimated": [x, y, 0.3], "error": [0.0, y, 0.1, 0.0, 0.0, 0.0]}
        for x, y in zip(np.linspace(0.0, distance_m, 3), np.linspace(0.0, error_m, 3), strict=True)
    ]
    named = {"robot": "go1", "policy": "trot", "path": "rectangle", "plant": "randomised", "fell": False}
    figures = {"distance_m": distance_m, "drift_percent": 100.0 * error_m / distance_m, "rows": rows}
    return named | figures | more


def test_errors_are_compared_after_the_same_distance_which_most_walks_reached() -> None:
    distance, (low, middle, high) = drift_over_distance([walk(2.0, 0.2), walk(1.0, 0.3)])
    at = round(0.5 / STEP_M)
    assert distance[at] == pytest.approx(0.5)
    # Percentiles of the errors of both walks: 0.05 m and 0.15 m.
    assert (low[at], middle[at], high[at]) == pytest.approx((0.055, 0.1, 0.145))
    distance, _ = drift_over_distance([walk(9.0, 0.1), walk(2.0, 0.1), walk(1.0, 0.1)])
    assert 1.9 < distance[-1] < 2.0


def test_walks_of_several_robots_make_a_picture_and_no_walk_is_refused(tmp_path: Path) -> None:
    from PIL import Image

    fallen = walk(1.0, 5.0, fell=True, drift_percent=None)
    plot([walk(1.0, 0.1), walk(2.0, 0.1, robot="g1", policy="g1-flat"), fallen], 2.0, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert image.width == 1400
    with pytest.raises(ValueError):  # noqa: PT011
        plot([walk(1.0, 0.1, plant="nominal")], 2.0, tmp_path / "a.png")
