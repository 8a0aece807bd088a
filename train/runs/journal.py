"""A training's journal: what it logs, shows, checks and keeps, whichever trainer writes it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from footfall.common.errors import CannotWriteError, UserError
from footfall.train.runs.display import Display
from footfall.train.runs.failure import failed, failure_of
from footfall.train.runs.metrics import MetricsLog
from footfall.train.runs.folder import Run
from footfall.train.runs.speed import Speed


class Journal:
    """Follows one run from its first or resumed iteration.

    A full disk does not end a training while there is hope: it is said once, and tried again.
    """

    def __init__(self, run: Run, iterations_done: int, display: Display) -> None:
        """
        Raises:
            CannotWriteError: the run folder cannot be written.
        """
        self._run = run
        self._display = display
        self._steps = run.config.ppo.steps_per_iteration
        self._log = MetricsLog(run.folder, iterations_done * self._steps)
        self._refused: set[str] = set()
        self._kept_at = time.monotonic()
        self._speed = Speed(self._kept_at, iterations_done * self._steps)

    def report(self, iteration: int, metrics: dict[str, float]) -> None:
        """Record and show the metrics of an iteration, the first of which is 1.

        Raises:
            UserError: they say that the training has failed.
        """
        steps = iteration * self._steps
        speed = self._speed.after(time.monotonic(), steps)
        with self._going_on("metrics"):
            self._log.write(steps, metrics | {"speed/steps_per_s": speed})
        reason = failure_of(metrics, self._run.config.diverged_limit)
        if reason is not None:
            raise failed(self._run, iteration, reason)
        self._display.update(steps, speed, metrics)

    @property
    def checkpoint_due(self) -> bool:
        return time.monotonic() - self._kept_at > self._run.config.checkpoint_interval_s

    def keep(self, save: Callable[[], object]) -> None:
        """Write a checkpoint in the middle of a training; if the disk is full, the next one is awaited."""
        with self._going_on("checkpoint"):
            save()
        self._kept_at = time.monotonic()

    def close(self) -> None:
        self._log.close()

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


class Follower:
    """In a process that does not lead, a journal that only notices failures."""

    checkpoint_due = False

    def __init__(self, run: Run) -> None:
        self._run = run

    def report(self, iteration: int, metrics: dict[str, float]) -> None:
        """
        Raises:
            UserError: the metrics say that the training has failed.
        """
        reason = failure_of(metrics, self._run.config.diverged_limit)
        if reason is not None:
            raise UserError(f"training failed in iteration {iteration}: {reason}; see process 0")

    def keep(self, save: Callable[[], object]) -> None:
        """Take part in gathering a checkpoint, which the leader writes."""
        save()

    def close(self) -> None:
        """Nothing is open."""
