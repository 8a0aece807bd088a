"""The 3-D page of a run, served by a separate process beside the control loop."""

import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from footfall.common.child_process import end_with_parent
from footfall.common.errors import UserError
from footfall.pages.page import check_page
from footfall.robots.description import Robot, load_robot

NICENESS = 5


@contextmanager
def viewed(robot: Robot, feed: Path, host: str, port: int) -> Iterator[str]:
    """Serve the page while the context lasts; yields its address.

    Raises:
        UserError: viser is not installed, or the address is not available.
    """
    check_page(host, port)
    arguments = (robot.folder, feed, host, port)
    process = multiprocessing.get_context("spawn").Process(target=_serve, args=arguments, daemon=True)
    process.start()
    try:
        yield f"http://{host}:{port}"
    finally:
        process.terminate()
        process.join()


def _serve(folder: Path, feed: Path, host: str, port: int) -> None:
    """In the other process: serve until it is terminated, or until the run's process has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's Ctrl-C is for the loop
    os.nice(NICENESS)
    end_with_parent()
    from footfall.pages.live import show_run

    try:
        show_run(load_robot(folder), feed, host, port)
    except UserError as error:
        print(f"footfall: the page ended: {error}", file=sys.stderr)
