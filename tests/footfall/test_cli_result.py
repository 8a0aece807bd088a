"""The result of a run reaches its user however the run ends. Each run is a process of its own."""

import json
import os
import pty
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from quick_relaxed import write_quick

FOOTFALL = [sys.executable, "-m", "footfall"]


@pytest.fixture
def walk(tmp_path: Path) -> list[str]:
    """A command for a short run by the wall clock, with figures in run.json."""
    return [
        *FOOTFALL, "deploy", "stand", "--realtime", "--config", write_quick(tmp_path),
        "--json", str(tmp_path / "run.json"), "--duration",
    ]  # fmt: skip


def figures(folder: Path) -> dict:
    return json.loads((folder / "run.json").read_text())


def walking_on_a_terminal(walk: list[str], duration_s: str, folder: Path) -> tuple[int, int]:
    """Id of a process whose robot walks, and its terminal."""
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(folder)
        os.execv(walk[0], [*walk, duration_s])
    read = b""
    while b"WALKING" not in read:
        read += os.read(terminal, 1000)
    return child, terminal


@pytest.mark.parametrize("closed", [True, False], ids=["terminal closed", "Ctrl-C"])
def test_a_closed_terminal_and_ctrl_c_end_the_run_in_order(
    walk: list[str], tmp_path: Path, closed: bool
) -> None:
    """The robot lies down and the figures are written, even if every write to the terminal fails."""
    child, terminal = walking_on_a_terminal(walk, "600", tmp_path)
    if closed:
        os.close(terminal)
        os.kill(child, signal.SIGHUP)  # the shell's signal, after the kernel's
    else:
        os.write(terminal, b"\x03")
        with suppress(OSError):  # the process has closed the terminal
            while os.read(terminal, 1000):
                pass
        os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
    ended = figures(tmp_path)
    assert ended["final_state"] == "IDLE"
    assert ended["walked_s"] < 60.0


def test_a_pipe_without_a_reader_ends_the_run_in_order(walk: list[str], tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while os.write(writer, b"x" * 4096):
            pass
    os.set_blocking(writer, True)
    done = subprocess.run(
        [*walk, "0.5"], stdout=writer, stderr=subprocess.PIPE, text=True, timeout=60, check=False
    )
    os.close(reader)
    os.close(writer)
    assert done.returncode == 0  # the figures are in the requested file
    assert "cannot show the result" in done.stderr
    assert "the run ended: IDLE" in done.stderr
    assert figures(tmp_path)["final_state"] == "IDLE"


POLICY = """
import os, resource
from footfall import load_policy, load_robot

class Mine:
    name, rate_hz, needs_estimate, contract, notes = "mine", 50.0, False, None, ()

    def __init__(self, robot):
        self._stand, self._steps = load_policy("stand", robot), 0

    def reset(self, inputs):
        self._stand.reset(inputs)

    def stance(self):
        return None

    def act(self, inputs):
        self._steps += 1
        if self._steps == 20:
            {act}
        return self._stand.act(inputs)
"""


@pytest.mark.parametrize(
    ("act", "state", "status"),
    [
        ("os._exit(0)", "ESTOP", 1),
        # SIGALRM without an alarm, SIGUSR1
        ("os.kill(os.getpid(), 14); os.kill(os.getpid(), 10); os.fork()", "IDLE", 0),
    ],
    ids=["os._exit", "signals and fork"],
)
def test_a_policy_that_exits_the_process_has_failed(
    walk: list[str], tmp_path: Path, act: str, state: str, status: int
) -> None:
    (tmp_path / "mine.py").write_text(POLICY.format(act=act))
    walk[walk.index("stand")] = "mine:Mine"
    done = subprocess.run([*walk, "1"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (status, "")
    assert figures(tmp_path)["final_state"] == state
    assert state in done.stdout
