"""Locks on resources that one process at a time may use."""

import os
import re
import signal
import subprocess
import sys

import pytest

from footfall.common import locks
from footfall.common.errors import UserError
from footfall.common.locks import locked

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="locks exist on Linux alone")

HOLD = """
import sys, time
from footfall.common import locks
locks.NAMESPACE = sys.argv[1]
with locks.locked(sys.argv[2], "it"):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize("name", ["bus/can0", "bus/" + 200 * "a"])
def test_another_process_is_named_until_it_ends_or_is_killed(name: str) -> None:
    command = [sys.executable, "-c", HOLD, locks.NAMESPACE, name]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(UserError, match=rf"^bus can0 .*\b{other.pid}\b"), locked(name, "bus can0"):
            pass
        other.send_signal(signal.SIGKILL)
    with locked(name, "bus can0"):  # nothing stale is left
        pass


def test_the_holder_is_named_however_often_a_lock_is_refused() -> None:
    with locked("a", "a"):
        for _ in range(20):
            with pytest.raises(UserError, match=str(os.getpid())), locked("a", "a"):
                pass


def test_a_lock_of_this_process_is_named_and_other_resources_are_free() -> None:
    again = pytest.raises(UserError, match=re.escape(f"this process ({os.getpid()})"))
    with locked("a", "a"), locked("b", "b"), again, locked("a", "a"):
        pass
    with locked("a", "a"):
        pass
