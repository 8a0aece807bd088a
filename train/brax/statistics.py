"""Running statistics of observations.

brax's function passes over the rollout twice, the second time with the new mean. Over several devices it
waits for two collectives an observation, and one for the count. Its formulas are solved here for means of the
differences to the previous mean and of their squares: one pass, and moments that travel in one vector with
the metrics. The results are equal up to rounding; one device keeps brax's.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from brax.training.acme import running_statistics
from brax.training.acme.running_statistics import RunningStatisticsState

MIN_STD = 0.02  # smallest deviation to divide by: an observation that hardly varies is not amplified
MAX_STD = 1e6


def add_samples(
    normalizer: RunningStatisticsState, observation: dict[str, jax.Array]
) -> RunningStatisticsState:
    """The statistics after further observations (..., size), all on this device."""
    return running_statistics.update(normalizer, observation, std_min_value=MIN_STD, std_max_value=MAX_STD)


class Moments(NamedTuple):
    """Means over samples of the difference to the previous mean and of its square, by observation."""

    first: dict[str, jax.Array]  # (size,) each
    second: dict[str, jax.Array]


def moments(normalizer: RunningStatisticsState, observation: dict[str, jax.Array]) -> Moments:
    """Moments of observations (..., size). Moments of equal shares average to the moments of the whole."""
    difference = {name: x - normalizer.mean[name] for name, x in observation.items()}
    return Moments(
        {name: d.mean(axis=range(d.ndim - 1)) for name, d in difference.items()},
        {name: jnp.square(d).mean(axis=range(d.ndim - 1)) for name, d in difference.items()},
    )


def add_moments(normalizer: RunningStatisticsState, new: Moments, samples: int) -> RunningStatisticsState:
    """The statistics after further samples, with these moments (Welford's algorithm for batches)."""
    count = normalizer.count + samples
    total = jnp.float32(count.hi) * 2.0**32 + jnp.float32(count.lo)
    shift = {name: samples / total * first for name, first in new.first.items()}
    squares = {
        name: normalizer.summed_variance[name] + samples * (second - shift[name] * new.first[name])
        for name, second in new.second.items()
    }
    return normalizer.replace(
        count=count,
        mean={name: normalizer.mean[name] + change for name, change in shift.items()},
        summed_variance=squares,
        std={
            name: jnp.clip(jnp.sqrt(jnp.maximum(square, 0) / total), MIN_STD, MAX_STD)
            for name, square in squares.items()
        },
    )
