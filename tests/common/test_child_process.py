"""A child process ends when its input is closed, or is killed."""

import signal
import subprocess

from footfall.common.child_process import end_by_input


def test_a_child_ends_with_its_input_or_is_killed() -> None:
    ends = {}
    for command in (("cat",), ("sleep", "20")):
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        end_by_input(child, 10.0 if command == ("cat",) else 0.05)
        ends[command[0]] = child.returncode
    assert ends == {"cat": 0, "sleep": -signal.SIGKILL}
