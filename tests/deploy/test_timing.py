"""Timing of the loop: figures of the last durations, in memory of constant size."""

import numpy as np

from footfall.deploy.timing import Durations, Timing


def test_the_last_durations_are_kept_in_order_and_the_longest_always() -> None:
    durations = Durations(kept=4)
    for value in (9.0, 1.0, 2.0):
        durations.add(value)
    assert durations.values().tolist() == [9.0, 1.0, 2.0]
    for value in (3.0, 4.0, 5.0, 6.0):
        durations.add(value)
    assert durations.values().tolist() == [3.0, 4.0, 5.0, 6.0]
    assert (durations.count, durations.longest) == (7, 9.0)


def test_a_summary_names_median_tail_and_longest_of_each() -> None:
    timing = Timing(policy_ms=Durations(kept=4))
    for value in range(101):
        timing.tick_us.add(float(value))
        timing.policy_ms.add(100.0 - value)
    figures = timing.summary()
    assert (figures["tick_us_p50"], figures["tick_us_p99"], figures["tick_us_max"]) == (50.0, 99.0, 100.0)
    assert (figures["policy_ms_p50"], figures["policy_ms_max"]) == (1.5, 100.0)
    assert (figures["ticks"], figures["lateness_us_max"]) == (101, 0.0)
    assert np.isfinite(list(figures.values())).all()
