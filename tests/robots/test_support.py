"""The static stability margin, by hand."""

import math

import pytest

from footfall.robots.support import support_margin

TRIANGLE = [(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)]  # sides 4, 3, 5


def test_the_distance_to_the_nearest_edge() -> None:
    for point, margin in (
        ((1.0, 1.0), 1.0),  # the centre of the inscribed circle
        ((0.5, 1.0), 0.5),
        ((2.0, 0.1), 0.1),
        ((2.0, -0.5), -0.5),
        ((4.0 + 0.8, 3.0 + 0.6), -(4.8 * 3 + 3.6 * 4 - 12) / 5),
        ((-3.0, -4.0), -5.0),  # nearest to a corner, not to the line of an edge
    ):
        assert support_margin(TRIANGLE, point) == pytest.approx(margin)
        assert support_margin(TRIANGLE[::-1], point) == pytest.approx(margin)


def test_feet_within_the_polygon_change_nothing() -> None:
    feet = [(1.0, 1.0), *TRIANGLE, (2.0, 0.0), (0.3, 0.4)]
    assert support_margin(feet, (0.5, 1.0)) == pytest.approx(0.5)


def test_feet_that_span_no_area_support_nothing() -> None:
    assert support_margin([], (0.0, 0.0)) == -math.inf
    assert support_margin([(3.0, 4.0)], (0.0, 0.0)) == -5.0
    assert support_margin([(-1.0, 2.0), (3.0, 2.0)], (0.5, 0.0)) == -2.0
    assert support_margin([(0.0, 0.0), (1.0, 1.0), (3.0, 3.0)], (1.0, 0.0)) == pytest.approx(-math.sqrt(0.5))
    assert support_margin([(0.0, 0.0), (1.0, 1.0), (3.0, 3.0)], (2.0, 2.0)) == pytest.approx(0.0)
    assert support_margin([(0.0, 0.0), (1.0, 1.0), (3.0, 3.0)], (5.0, 5.0)) == pytest.approx(-math.sqrt(8.0))
