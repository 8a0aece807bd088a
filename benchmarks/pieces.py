"""Long measurements in pieces: each result is a line of a file as soon as it is there.

A run that was killed, or that ran out of time, goes on where it stopped when it is started again.
"""

import json
import time
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from pathlib import Path
from typing import Any

Result = dict[str, Any]


class ResultsFile:
    """One JSON object a line. A line that was torn off by a kill counts as not written."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.results: list[Result] = []
        content = path.read_text() if path.exists() else ""
        for line in content.splitlines():
            with suppress(json.JSONDecodeError):
                self.results.append(json.loads(line))
        if content and not content.endswith("\n"):
            self._write("\n")

    def add(self, result: Result) -> None:
        self.results.append(result)
        self._write(json.dumps(result) + "\n")

    def _write(self, text: str) -> None:
        with self._path.open("a") as file:
            file.write(text)


def run_pieces(
    work: Callable[[Any], Result],
    pieces: Iterable[Any],
    file: ResultsFile,
    workers: int = 1,
    time_limit_s: float = float("inf"),
) -> bool:
    """Do what the file does not hold yet.

    Args:
        work: a function of a module, from a piece to its result.
        pieces: JSON values that tell one from the other.
        file: gets each result with its piece as it comes.
        workers: processes; 1 for this one.
        time_limit_s: after which no piece begins.

    Returns:
        Whether all pieces are done.
    """
    done = {json.dumps(result["piece"]) for result in file.results}
    waiting = [piece for piece in pieces if json.dumps(piece) not in done]
    began = time.monotonic()
    if workers == 1:
        while waiting and time.monotonic() - began < time_limit_s:
            piece = waiting.pop(0)
            file.add({"piece": piece, **work(piece)})
        return not waiting
    with ProcessPoolExecutor(workers) as pool:
        under_way: dict[Future[Result], Any] = {}
        while under_way or waiting:
            while waiting and len(under_way) < workers and time.monotonic() - began < time_limit_s:
                piece = waiting.pop(0)
                under_way[pool.submit(work, piece)] = piece
            if not under_way:
                break
            for future in wait(under_way, return_when=FIRST_COMPLETED).done:
                file.add({"piece": under_way.pop(future), **future.result()})
    return not waiting
