"""Child processes, scripts that start processes, and calls with a time limit."""

import signal
import subprocess
import sys
import threading
from pathlib import Path
from unittest.mock import Mock

from footfall.common.child_process import end_by_input
from footfall.common.in_time import call_in_time


def test_a_child_ends_with_its_input_or_is_killed() -> None:
    for command, timeout_s, status in ((["cat"], 10.0, 0), (["sleep", "20"], 0.05, -signal.SIGKILL)):
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        end_by_input(child, timeout_s)
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


def test_a_call_returns_none_or_its_error_and_is_a_timeout_if_it_does_not_end() -> None:
    wrong = OSError("full")
    assert call_in_time(lambda: None) is None
    assert call_in_time(Mock(side_effect=wrong)) is wrong
    caller, began, ended = [], threading.Event(), threading.Event()

    def wait() -> None:
        caller.append(threading.current_thread())
        began.set()
        ended.wait()

    try:
        assert isinstance(call_in_time(wait, 0.01), TimeoutError)
    finally:  # a command line in this process would not flush its output while it waits
        ended.set()
        began.wait()
        caller[0].join()
