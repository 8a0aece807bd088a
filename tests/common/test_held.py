"""Locks on resources that one process at a time may use."""

import os
import re
import signal
import subprocess
import sys

import pytest

from footfall.common import held as module
from footfall.common.errors import UserError
from footfall.common.held import held

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="held on Linux alone")

HOLD = """
import sys, time
from footfall.common import held
held.NAMESPACE = sys.argv[1]
with held.held(sys.argv[2], "it"):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize("name", ["bus/can0", "bus/" + 200 * "a"])
def test_another_process_is_named_until_it_ends_or_is_killed(name: str) -> None:
    command = [sys.executable, "-c", HOLD, module.NAMESPACE, name]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(UserError, match=rf"^bus can0 .*\b{other.pid}\b"), held(name, "bus can0"):
            pass
        other.send_signal(signal.SIGKILL)
    with held(name, "bus can0"):  # nothing stale is left
        pass


def test_a_lock_of_this_process_is_named_and_other_resources_are_free() -> None:
    again = pytest.raises(UserError, match=re.escape(f"this process ({os.getpid()})"))
    with held("a", "a"), held("b", "b"), again, held("a", "a"):
        pass
    with held("a", "a"):
        pass
