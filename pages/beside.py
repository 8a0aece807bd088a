"""The page of a run that this process trains, served by another process at low priority."""

import multiprocessing
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

from footfall.common.child_process import end_with_parent
from footfall.common.errors import UserError
from footfall.train.runs.stop import StopRequest

NICENESS = 10


@contextmanager
def watched(run: Path, host: str, port: int) -> Iterator[None]:
    """Serve the page of a run while the context lasts."""
    arguments = (run, host, port)
    process = multiprocessing.get_context("spawn").Process(target=_serve, args=arguments, name="watch")
    process.start()
    try:
        yield
    finally:
        process.terminate()
        process.join()


def _serve(run: Path, host: str, port: int) -> None:
    """In the other process: serve until SIGTERM, or until the training's process has ended."""
    os.nice(NICENESS)
    with StopRequest() as stop, Path(os.devnull).open("w") as devnull, redirect_stdout(devnull):
        end_with_parent()
        from footfall.pages.walk import watch

        try:
            watch(run, host, port, stop)
        except UserError as error:
            print(f"footfall: the page ended: {error}", file=sys.stderr)
