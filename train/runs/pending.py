"""Metrics of the newest iteration, which the device may still compute."""

from collections.abc import Callable

import jax

from footfall.train.stacked import floats
from footfall.train.trainer import Metrics

EPISODE_LENGTH = "episode/length_s"


class PendingMetrics:
    """Passes an iteration's metrics to a function when they are computed, while the next iteration runs."""

    def __init__(self, receive: Callable[[int, dict[str, float]], None]) -> None:
        """
        Args:
            receive: called with each iteration, from 1, and its metrics.
        """
        self._receive = receive
        self._pending: tuple[int, Metrics] | None = None

    def report(self, iteration: int, metrics: Metrics) -> None:
        """Store an iteration's metrics, and pass on those of the previous iteration."""
        self.flush()
        self._pending = iteration, metrics
        if not any(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(metrics)):
            self.flush()

    def flush(self) -> None:
        """Wait for the pending metrics and pass them on."""
        if self._pending is None:
            return
        iteration, metrics = self._pending
        self._pending = None
        figures = floats(metrics)
        if figures.get(EPISODE_LENGTH) == 0.0:  # no episode ended: there is no length
            del figures[EPISODE_LENGTH]
        self._receive(iteration, figures)
