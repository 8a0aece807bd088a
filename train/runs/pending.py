"""Metrics of the newest iteration, which the device may still compute."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

import jax

from footfall.train.stacked import floats
from footfall.train.trainer import Metrics

EPISODE_LENGTH = "episode/length_s"


class PendingMetrics:
    """Passes an iteration's metrics to a function when they are computed, while the next iteration runs.

    The function runs in another thread: a GPU's iteration of a few milliseconds is launched by this one.
    """

    def __init__(self, receive: Callable[[int, dict[str, float]], None]) -> None:
        """
        Args:
            receive: called with each iteration, from 1, and its metrics.
        """
        self._receive = receive
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="metrics")
        self._pending: Future[None] | None = None

    def __enter__(self) -> "PendingMetrics":
        return self

    def __exit__(self, *_: object) -> None:
        self._thread.shutdown()

    def report(self, iteration: int, metrics: Metrics) -> None:
        """Begin to pass on an iteration's metrics, once those of the previous iteration are passed on."""
        self.flush()
        self._pending = self._thread.submit(self._pass_on, iteration, metrics)
        if not any(isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(metrics)):
            self.flush()

    def flush(self) -> None:
        """Wait until the pending metrics are passed on; raises what the function raised."""
        pending, self._pending = self._pending, None
        if pending is not None:
            pending.result()

    def _pass_on(self, iteration: int, metrics: Metrics) -> None:
        figures = floats(metrics)
        if figures.get(EPISODE_LENGTH) == 0.0:  # no episode ended: there is no length
            del figures[EPISODE_LENGTH]
        self._receive(iteration, figures)
