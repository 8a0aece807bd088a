"""A run's journal, kept by the main process: logs and shows metrics, and writes checkpoints."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from footfall.common.errors import CannotWriteError
from footfall.train.runs.display import Display
from footfall.train.runs.folder import Run
from footfall.train.runs.metrics import MetricsLog
from footfall.train.runs.speed import Speed


class Journal:
    """Logs and shows one run, from its first or resumed iteration.

    A full disk does not end the training: it is reported once, and writing is tried again.
    """

    def __init__(self, run: Run, iterations_done: int, display: Display) -> None:
        """
        Raises:
            CannotWriteError: the run folder cannot be written.
        """
        self._display = display
        self._steps_per_iteration = run.config.ppo.steps_per_iteration
        steps = iterations_done * self._steps_per_iteration
        self._log = MetricsLog(run.folder, steps)
        self._interval_s = run.config.checkpoint_interval_s
        self._saved_at = time.monotonic()
        self._speed = Speed(self._saved_at, steps)
        self._not_written: set[str] = set()

    @property
    def checkpoint_due(self) -> bool:
        """Whether the newest checkpoint is older than the interval."""
        return time.monotonic() - self._saved_at > self._interval_s

    def log(self, iteration: int, metrics: Mapping[str, float]) -> None:
        """Append an iteration's metrics to the log and show them."""
        steps = iteration * self._steps_per_iteration
        speed = self._speed.after(time.monotonic(), steps)
        with self._reporting_full_disk("metrics"):
            self._log.write(steps, {**metrics, "speed/steps_per_s": speed})
        self._display.update(steps, speed, dict(metrics))

    def save(self, write: Callable[[], object]) -> None:
        """Write a checkpoint; if the disk is full, wait for the next interval."""
        with self._reporting_full_disk("checkpoint"):
            write()
        self._saved_at = time.monotonic()

    def close(self) -> None:
        """Close the log."""
        self._log.close()

    @contextmanager
    def _reporting_full_disk(self, what: str) -> Iterator[None]:
        try:
            yield
        except CannotWriteError as error:
            if what not in self._not_written:
                self._display.report(f"{error}; training continues and tries again")
            self._not_written.add(what)
        else:
            if what in self._not_written:
                self._display.report(f"{what} can be written again")
            self._not_written.discard(what)
