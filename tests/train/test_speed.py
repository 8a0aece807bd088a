"""The speed that a training shows."""

import pytest

from footfall.train.runs.speed import WINDOW_S, Speed


def test_a_burst_of_reports_does_not_look_fast() -> None:
    speed = Speed(0.0, 0)
    assert speed.after(2.0, 100) == 50.0
    assert speed.after(2.000001, 200) == pytest.approx(100.0, rel=1e-3)


def test_what_was_long_ago_no_longer_counts() -> None:
    speed = Speed(0.0, 1000)  # resumed
    assert speed.after(WINDOW_S, 1010) == pytest.approx(10 / WINDOW_S)
    assert speed.after(2 * WINDOW_S, 1110) == pytest.approx(100 / WINDOW_S)


def test_an_iteration_longer_than_the_window_has_its_own_speed() -> None:
    speed = Speed(0.0, 0)
    speed.after(3 * WINDOW_S, 10)
    assert speed.after(6 * WINDOW_S, 70) == pytest.approx(60 / (3 * WINDOW_S))


def test_it_is_of_the_last_five_seconds() -> None:
    speed = Speed(0.0, 0)
    for second in range(1, 21):
        latest = speed.after(float(second), 100 * second if second <= 14 else 1400 + 7 * (second - 14))
    assert latest == 7.0
    assert speed.after(21.0, 1449 + 500) == (1449 + 500 - 1414) / 5.0
