"""Timing of the loop: figures of the last durations, in memory of constant size."""

from footfall.deploy.timing import Durations


def test_the_last_durations_are_kept_in_order_and_the_longest_always() -> None:
    durations = Durations(capacity=4)
    for value in (9.0, 1.0, 2.0):
        durations.add(value)
    assert durations.values().tolist() == [9.0, 1.0, 2.0]
    for value in (3.0, 4.0, 5.0, 6.0):
        durations.add(value)
    assert durations.values().tolist() == [3.0, 4.0, 5.0, 6.0]
    assert (durations.count, durations.longest) == (7, 9.0)
