"""The process that serves a run's 3-D page."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

RUN = """
import sys, time
from pathlib import Path
from footfall.pages.run_page import viewed
from footfall.robots.description import load_robot

if __name__ == "__main__":
    with viewed(load_robot("go1"), Path(sys.argv[1]), "localhost", int(sys.argv[2])):
        time.sleep(600.0)
"""
PATIENCE_S = 60.0


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("localhost", port)) == 0


def wait_until(port: int, served: bool) -> None:
    end = time.monotonic() + PATIENCE_S
    while listens(port) is not served:
        assert time.monotonic() < end
        time.sleep(0.1)


def test_it_ends_with_a_run_that_was_killed_so_that_the_next_run_has_its_port(tmp_path: Path) -> None:
    with socket.socket() as free:
        free.bind(("localhost", 0))
        port = free.getsockname()[1]
    script = tmp_path / "run.py"
    script.write_text(RUN)
    run = subprocess.Popen([sys.executable, script, tmp_path / "feed", str(port)])
    try:
        wait_until(port, served=True)
        os.kill(run.pid, signal.SIGKILL)
        wait_until(port, served=False)
    finally:
        run.kill()
        run.wait()
