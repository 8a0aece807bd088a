"""Delays of the simulated robot's readings."""

import numpy as np

from footfall.domain_rand.sample import Sample
from footfall.plant.delays import DelayLine


def test_jitter_never_shows_an_older_moment_after_a_newer_one() -> None:
    sample = Sample(observation_delay_s=np.array(0.002), observation_jitter_s=np.array(0.012))
    delay_line, shown = DelayLine[int](sample, 0.001, seed=3), []
    for step in range(600):
        delay_line.push(step)
        shown.append(delay_line.delayed())
    assert (np.diff(shown) >= 0).all()
    late = (np.arange(600) - shown)[20:]
    assert set(late) <= set(range(2, 15))
    assert len(set(late)) > 8
