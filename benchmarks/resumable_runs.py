"""Resumable runs for benchmarks: each finished run is written to a file, and a second call skips it.

A helper, not a benchmark. A run is a line of JSON, `{"task": …, "result": …}`; runs in the file
are not repeated.
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from footfall.evaluate.pool import run_all

T = TypeVar("T", bound=tuple[Any, ...])


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add --workers, --out and --time-limit, which `run_resumable` takes."""
    parser.add_argument("--workers", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, help="file of results; runs in it are not run again")
    parser.add_argument("--time-limit", type=float, help="seconds after which no further run starts")


def run_resumable(
    function: Callable[[T], dict[str, Any]],
    tasks: Sequence[T],
    out: Path | None,
    workers: int | None = None,
    time_limit_s: float | None = None,
) -> tuple[list[dict[str, Any]], list[str]]:
    """Results of the tasks that have one, in their order, and a line for each that failed.

    Args:
        function: function from this module's importer, called with a task in a separate process.
        tasks: tasks of strings, numbers and None, so that a line of the file names its task.
        out: the file; None for one that is deleted.
        workers: processes; one for each core if None.
        time_limit_s: no task begins after it.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = out or Path(folder) / "runs.jsonl"
        kept = read_runs(path)
        if path.exists() and not path.read_bytes().endswith(b"\n"):  # stopped in the middle of a line
            path.write_bytes(path.read_bytes() + b"\n")
        waiting = [task for task in tasks if json.dumps(task) not in kept]
        deadline_s = None if time_limit_s is None else time.time() + time_limit_s
        outcomes = run_all(partial(_run_one, function, path, deadline_s), waiting, workers)
        kept = read_runs(path)
    errors = [
        f"{task}: {outcome.error}" for task, outcome in zip(waiting, outcomes, strict=True) if outcome.error
    ]
    done = [kept[json.dumps(task)] for task in tasks if json.dumps(task) in kept]
    if len(done) + len(errors) < len(tasks):
        errors.append(
            f"{len(tasks) - len(done) - len(errors)} of {len(tasks)} runs are left for another call"
        )
    return done, errors


def read_runs(path: Path) -> dict[str, dict[str, Any]]:
    """Results in a file by their task's JSON; a line that was cut off is as if it had not been run."""
    kept = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            continue
        kept[json.dumps(entry["task"])] = entry["result"]
    return kept


def _run_one(function: Callable[[T], dict[str, Any]], path: Path, deadline_s: float | None, task: T) -> None:
    if deadline_s is not None and time.time() > deadline_s:
        return
    line = json.dumps({"task": task, "result": function(task)}) + "\n"
    with path.open("ab", buffering=0) as file:  # one write, at the end: lines of several processes do not mix
        file.write(line.encode())
