"""Child processes, scripts that start processes, and calls with a timeout."""

import signal
import subprocess
import sys
import threading
from pathlib import Path
from unittest.mock import Mock

from footfall.common.blocking_threads import call_with_timeout
from footfall.common.child_process import end_by_closing_input


def test_a_child_ends_when_its_input_is_closed_or_is_killed() -> None:
    for command, timeout_s, status in ((["cat"], 10.0, 0), (["sleep", "20"], 0.05, -signal.SIGKILL)):
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        end_by_closing_input(child, timeout_s)
        assert child.returncode == status


CALL = """
from footfall.evaluate.pool import run_all
def score():
    run_all(abs, [-1], workers=1)
score()
"""


def test_a_script_without_a_main_guard_is_refused_with_advice(tmp_path: Path) -> None:
    script = tmp_path / "mine.py"
    script.write_text(CALL)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1, done.stderr
    assert done.stderr.splitlines()[-1].endswith(
        "UserError: mine.py, line 5 starts processes that import mine.py:"
        ' put its main part under if __name__ == "__main__":'
    )


def test_a_call_gives_none_or_its_error_or_after_the_timeout_a_timeout_error() -> None:
    error = OSError("full")
    assert call_with_timeout(lambda: None) is None
    assert call_with_timeout(Mock(side_effect=error)) is error
    threads, began, released = [], threading.Event(), threading.Event()

    def block() -> None:
        threads.append(threading.current_thread())
        began.set()
        released.wait()

    try:
        assert isinstance(call_with_timeout(block, 0.01), TimeoutError)
    finally:  # with a blocked call, a command line in this process would not flush its output
        released.set()
        began.wait()
        threads[0].join()
