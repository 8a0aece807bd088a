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


def test_a_killed_run_takes_its_page_with_it_so_that_the_next_run_has_the_port(tmp_path: Path) -> None:
    port, script = free_port(), tmp_path / "run.py"
    script.write_text(RUN)
    run = subprocess.Popen([sys.executable, script, tmp_path / "feed", str(port)])
    try:
        wait_until_served(port)
        run.kill()
        wait_until_served(port, False)
    finally:
        run.kill()
        run.wait()
