"""A training's journal: what it logs, shows, checks and saves, whichever trainer it follows."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import jax

from footfall.common.errors import CannotWriteError
from footfall.train.runs.display import Display
from footfall.train.runs.failure import failed, failure_of
from footfall.train.runs.folder import Run
from footfall.train.runs.metrics import MetricsLog
from footfall.train.runs.speed import Speed
from footfall.train.trainer import Metrics

EPISODE_LENGTH = "episode/length_s"


class FailureCheck:
    """Notices failures of a training: the journal of a process that does not write one."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._pending: tuple[int, Metrics] | None = None

    def report(self, iteration: int, metrics: Metrics) -> None:
        """Take an iteration's metrics; the first iteration is 1.

        Those that a device still computes are looked at in the next call, while the next iteration runs.

        Raises:
            UserError: metrics say that the training has failed.
        """
        self.flush()
        self._pending = iteration, metrics
        if not any(isinstance(value, jax.Array) for value in metrics.values()):
            self.flush()

    def flush(self) -> None:
        """Wait for metrics that are still computed, and look at them; raises as `report`."""
        if self._pending is not None:
            iteration, metrics = self._pending
            self._pending = None
            figures = {name: float(value) for name, value in metrics.items()}
            if figures.get(EPISODE_LENGTH) == 0.0:  # no episode has ended, so there is no length
                del figures[EPISODE_LENGTH]
            self._record(iteration, figures)

    @property
    def checkpoint_due(self) -> bool:
        return False

    def save(self, write: Callable[[], object]) -> None:
        """Take part in a checkpoint in the middle of a training, which the main process writes."""
        self.flush()
        write()

    def close(self) -> None:
        """Nothing is open."""

    def _record(self, iteration: int, metrics: dict[str, float]) -> None:
        reason = failure_of(metrics, self._run.config.diverged_limit)
        if reason is not None:
            raise failed(self._run, iteration, reason)


class Journal(FailureCheck):
    """Logs and shows one run from its first or resumed iteration.

    A full disk does not end a training while there is hope: it is said once, and tried again.
    """

    def __init__(self, run: Run, iterations_done: int, display: Display) -> None:
        """
        Raises:
            CannotWriteError: the run folder cannot be written.
        """
        super().__init__(run)
        self._display = display
        self._steps = run.config.ppo.steps_per_iteration
        self._log = MetricsLog(run.folder, iterations_done * self._steps)
        self._refused: set[str] = set()
        self._saved_at = time.monotonic()
        self._speed = Speed(self._saved_at, iterations_done * self._steps)

    @property
    def checkpoint_due(self) -> bool:
        return time.monotonic() - self._saved_at > self._run.config.checkpoint_interval_s

    def save(self, write: Callable[[], object]) -> None:
        """Write a checkpoint in the middle of a training; if the disk is full, wait for the next one."""
        self.flush()
        with self._going_on("checkpoint"):
            write()
        self._saved_at = time.monotonic()

    def close(self) -> None:
        self._log.close()

    def _record(self, iteration: int, metrics: dict[str, float]) -> None:
        steps = iteration * self._steps
        speed = self._speed.after(time.monotonic(), steps)
        with self._going_on("metrics"):
            self._log.write(steps, metrics | {"speed/steps_per_s": speed})
        super()._record(iteration, metrics)
        self._display.update(steps, speed, metrics)

    @contextmanager
    def _going_on(self, what: str) -> Iterator[None]:
        try:
            yield
        except CannotWriteError as error:
            if what not in self._refused:
                self._display.say(f"{error}; training goes on and tries again")
            self._refused.add(what)
        else:
            if what in self._refused:
                self._display.say(f"{what} can be written again")
            self._refused.discard(what)
