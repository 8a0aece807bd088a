"""The process that serves a run's 3-D page."""

import subprocess
import sys
from pathlib import Path

from ports import free_port, wait_until_served

RUN = """
import sys, time
from pathlib import Path
from footfall.pages.run_page import viewed
from footfall.robots.description import load_robot

if __name__ == "__main__":
    with viewed(load_robot("go1"), Path(sys.argv[1]), "localhost", int(sys.argv[2])):
        time.sleep(600.0)
"""
TRAINING = """
import sys, time
from pathlib import Path
from footfall.pages.beside import watched

if __name__ == "__main__":
    with watched(Path(sys.argv[1]), "localhost", int(sys.argv[2])):
        time.sleep(600.0)
"""


def kill_a_page(code: str, *arguments: Path) -> None:
    """Kill a process that serves a page; the page's port must be free afterwards."""
    port = free_port()
    script = arguments[0].parent / "run.py"
    script.write_text(code)
    run = subprocess.Popen([sys.executable, script, *arguments, str(port)])
    try:
        wait_until_served(port)
        run.kill()
        wait_until_served(port, False)
    finally:
        run.kill()
        run.wait()


def test_a_killed_run_takes_its_page_with_it_so_that_the_next_run_has_the_port(tmp_path: Path) -> None:
    kill_a_page(RUN, tmp_path / "feed")


def test_a_training_that_is_killed_takes_its_page_with_it(begun: Path) -> None:
    kill_a_page(TRAINING, begun)
