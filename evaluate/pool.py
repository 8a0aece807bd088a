"""Runs independent tasks in processes; each task returns a value or an error.

pebble's pool also reports the task of a process that died, but waits forever if the process ended with
status 0 (seen with 5.2.3).
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Generic, NamedTuple, TypeVar

from footfall.common.errors import UserError
from footfall.common.main_guard import check_main_guard
from footfall.common.processors import usable_cores

T = TypeVar("T")
R = TypeVar("R")

# Workers share the cores among themselves; threads inside a worker would compete with the other workers.
ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}

# The signals with which a user or an operating system ends a run.
ENDING_SIGNALS = {signal.SIGINT, signal.SIGTERM}


class TaskResult(NamedTuple, Generic[R]):
    """Result of a task: its value, or an error."""

    value: R | None
    error: str = ""


def run_all(
    function: Callable[[T], R],
    tasks: Sequence[T],
    workers: int | None = None,
    on_finished: Callable[[int], None] | None = None,
    environment: dict[str, str] | None = None,
) -> list[TaskResult[R]]:
    """Run a module-level function on every task, in fresh processes; outcomes in the order of the tasks.

    A task that raises, or whose process dies, ends in an error of one line; the others carry on. When a
    process dies, the tasks that were in flight are run once more, each in a process of its own, so that
    only the task that ends its process gets the error.

    Args:
        function: picklable, as are tasks and values.
        tasks: its arguments.
        workers: number of processes; None: one for each core.
        on_finished: called with the number of finished tasks, whenever one has finished.
        environment: variables for the processes.

    Raises:
        UserError: a task raised it, because of bad input.
    """
    if workers is not None and workers < 1:
        raise UserError(f"workers is {workers}: it must be 1 or more")
    check_main_guard()
    count = max(1, min(workers or usable_cores(), len(tasks)))
    outcomes: dict[int, TaskResult[R]] = {}

    def settle(index: int, outcome: TaskResult[R]) -> None:
        outcomes[index] = outcome
        if on_finished is not None:
            on_finished(len(outcomes))

    with _variables({**ONE_THREAD, **(environment or {})}):
        unsettled = list(range(len(tasks)))
        while unsettled:
            suspects = _run_until_broken(function, tasks, unsettled, count, settle)
            for suspect in suspects:
                if _run_until_broken(function, tasks, [suspect], 1, settle):
                    settle(suspect, TaskResult(None, "its process died"))
            unsettled = [index for index in unsettled if index not in outcomes]
    return [outcomes[index] for index in range(len(tasks))]


def _run_until_broken(
    function: Callable[[T], R],
    tasks: Sequence[T],
    indices: Sequence[int],
    workers: int,
    settle: Callable[[int, TaskResult[R]], None],
) -> list[int]:
    """Run tasks until all are settled or a process dies; returns the tasks in flight at that time."""
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_exit_with_parent)
    queue = iter(indices)
    in_flight: dict[Future[R], int] = {}
    earlier_children = context.active_children()
    try:
        _launch(pool, function, tasks, queue, in_flight, workers)
        while in_flight:
            finished, _ = wait(in_flight, return_when=FIRST_COMPLETED)
            for future in finished:
                error = future.exception()
                if isinstance(error, BrokenProcessPool):
                    return sorted(in_flight.values())
                if isinstance(error, UserError):
                    raise error
                index = in_flight.pop(future)
                settle(index, TaskResult(None, _one_line(error)) if error else TaskResult(future.result()))
            _launch(pool, function, tasks, queue, in_flight, workers)
        return []
    except BrokenProcessPool:  # raised by submit
        return sorted(in_flight.values())
    except KeyboardInterrupt:  # SIGTERM reaches only this process; a task may last for minutes
        for worker in context.active_children():
            if worker not in earlier_children:
                worker.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _launch(
    pool: ProcessPoolExecutor,
    function: Callable[[T], R],
    tasks: Sequence[T],
    queue: Iterator[int],
    in_flight: dict[Future[R], int],
    workers: int,
) -> None:
    """Keep at most one task per worker in flight, so that few tasks are suspects when a process dies."""
    while len(in_flight) < workers:
        index = next(queue, None)
        if index is None:
            return
        with _signals_delayed():  # it may start a process
            future = pool.submit(function, tasks[index])
        in_flight[future] = index


@contextmanager
def _signals_delayed() -> Iterator[None]:
    """Delay Ctrl-C and SIGTERM until after the block; processes started in it unblock them themselves.

    Earlier, a KeyboardInterrupt would end a process's imports with a traceback, and so would a parent that is
    interrupted before it has sent the task.
    """
    previous_mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, previous_mask)


def _exit_with_parent() -> None:
    """In a worker: exit when the parent has ended for any reason; its queue alone would wait forever.

    Ctrl-C ends a worker without a traceback, unless the command ignores it: a script's `command &` does.
    """
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING_SIGNALS)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _one_line(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


@contextmanager
def _variables(values: dict[str, str]) -> Iterator[None]:
    """Environment variables for processes that start inside the block."""
    previous = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in previous.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
