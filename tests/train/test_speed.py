"""The speed that a training shows."""

import pytest

from footfall.train.runs.speed import Speed


def test_a_burst_of_reports_does_not_raise_the_speed() -> None:
    speed = Speed(0.0, 0)
    assert speed.after(2.0, 100) == 50.0
    assert speed.after(2.000001, 200) == pytest.approx(100.0, rel=1e-3)


def test_the_speed_is_of_the_last_five_seconds() -> None:
    speed = Speed(0.0, 0)
    for second in range(1, 21):
        latest = speed.after(float(second), 100 * second if second <= 14 else 1400 + 7 * (second - 14))
    assert latest == 7.0
    assert speed.after(21.0, 1449 + 500) == (1449 + 500 - 1414) / 5.0
