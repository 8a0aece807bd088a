"""The installed command as a process: its libraries and signals, and its result however it ends."""

import json
import os
import pty
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from quick_relaxed import write_quick

ROOT = Path(__file__).parents[2]
FOOTFALL = [sys.executable, "-m", "footfall"]


def python(*tokens: str, **options: Any) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *tokens]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60, **options)


def test_the_api_and_help_import_no_large_library() -> None:
    code = (
        "import sys, footfall; from footfall.cli import main; main(['--help']);"
        "large = 'numpy', 'jax', 'mujoco', 'onnxruntime', 'can', 'matplotlib';"
        "print([name for name in large if name in sys.modules])"
    )
    done = python("-c", code)
    assert (done.returncode, done.stdout.splitlines()[-1]) == (0, "[]")


def test_ctrl_c_while_modules_are_loaded_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "cyclopts.py").write_text("raise KeyboardInterrupt")
    variables = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    done = python("-m", "footfall", "list", env=variables)
    assert (done.returncode, done.stderr) == (130, "footfall: interrupted\n")


def test_deploy_needs_no_learning_library(tmp_path: Path) -> None:
    """All commands run in one process.

    Deploy works without these libraries, on a robot also without the simulation; train names its extra.
    """
    (tmp_path / "sitecustomize.py").write_text(
        "import sys\n"
        "class Blocker:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in {'jax', 'jaxlib', 'torch', 'brax', 'flax', 'onnx'}:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Blocker())\n"
    )
    commands = [["deploy", "stand", "--duration", "0.2"], ["train", "--preset", "smoke"]]
    code = (
        "import sys; from footfall.cli import main;"
        "on_robot = main(['deploy', 'stand', '--bus', 'socketcan']);"
        "simulation = [name for name in sys.modules if name.startswith('footfall.plant')];"
        f"print(simulation, [on_robot, *map(main, {commands!r})])"
    )
    done = python("-c", code, env=os.environ | {"PYTHONPATH": str(tmp_path)}, cwd=ROOT)
    assert done.stdout.splitlines()[-1] == "[] [2, 0, 2]"
    without_interface, without_jax = done.stderr.splitlines()
    assert "'can0'" in without_interface
    assert "[train]'" in without_jax


def test_an_interrupted_command_does_not_wait_for_its_compiler() -> None:
    code = (
        "import sys, time; from concurrent.futures import ThreadPoolExecutor as Pool; "
        "from footfall import __main__, cli; from footfall.common.blocking_threads import COMPILER; "
        "Pool(1, COMPILER).submit(time.sleep, 300); "
        "cli.main = lambda: print('stopped') or 143; sys.exit(__main__.main())"
    )
    done = python("-c", code)
    assert (done.returncode, done.stdout) == (143, "stopped\n")


def test_a_signal_ends_an_evaluation_and_its_processes(tmp_path: Path) -> None:
    brief, folder = tmp_path / "brief.yaml", tmp_path / "folder"  # an episode that began is run to its end
    brief.write_text("scenarios: {brief: {about: Standing, episodes: 5000, duration_s: 0.5}}")
    folder.mkdir()
    scenario = ["--scenario-file", brief, "--scenarios", "brief"]
    process = subprocess.Popen(
        [*FOOTFALL, "evaluate", "stand", *scenario, "--workers", "2"],
        cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, start_new_session=True,
        env=os.environ | {"TMPDIR": str(folder)},
    )  # fmt: skip
    try:
        deadline = time.monotonic() + 60
        while len(processes_of(process.pid)) < 3 and time.monotonic() < deadline:
            time.sleep(0.1)
        process.send_signal(signal.SIGTERM)
        _, result = process.communicate(timeout=60)
        deadline = time.monotonic() + 5
        while (left := processes_of(process.pid)) and time.monotonic() < deadline:
            time.sleep(0.05)  # a process that ends still exists for a moment
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert (process.returncode, result) == (143, "footfall: terminated\n")
    assert left == []
    assert list(folder.iterdir()) == []


def processes_of(session: int) -> list[int]:
    """The processes of a session, without zombies."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            state, _, _, of = stat.read_text().rpartition(")")[2].split()[:4]
            found += [int(stat.parent.name)] if int(of) == session and state != "Z" else []
    return found


@pytest.fixture
def walk(tmp_path: Path) -> list[str]:
    """A command for a run by the wall clock, with figures in run.json; its duration follows."""
    return [
        *FOOTFALL, "deploy", "stand", "--realtime", "--config", write_quick(tmp_path),
        "--json", str(tmp_path / "run.json"), "--duration",
    ]  # fmt: skip


def figures(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "run.json").read_text()))


@pytest.mark.parametrize("closed", [True, False], ids=["terminal closed", "Ctrl-C"])
def test_a_closed_terminal_and_ctrl_c_end_the_run(walk: list[str], tmp_path: Path, closed: bool) -> None:
    """The robot lies down and the figures are written, even if every write to the terminal fails."""
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(tmp_path)
        os.execv(walk[0], [*walk, "600"])
    read = b""
    while b"WALKING" not in read:
        read += os.read(terminal, 1000)
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
    assert figures(tmp_path)["final_state"] == "IDLE"
    assert figures(tmp_path)["walked_s"] < 60.0


def test_a_pipe_without_a_reader_ends_the_run_in_order(walk: list[str], tmp_path: Path) -> None:
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with suppress(BlockingIOError):
        while os.write(writer, b"x" * 4096):
            pass
    os.set_blocking(writer, True)
    command = [*walk, "0.5"]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
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
    name, rate_hz, contract = "mine", 50.0, None

    def __init__(self, robot):
        self._stand, self._steps = load_policy("stand", robot), 0

    def __getattr__(self, name):
        return getattr(self._stand, name)

    def act(self, inputs):
        self._steps += 1
        if self._steps == 20:
            {act}
        return self._stand.act(inputs)
"""


def test_a_policy_that_exits_the_process_has_failed(walk: list[str], tmp_path: Path) -> None:
    walk[walk.index("stand")] = "mine:Mine"
    for act, state, status in (
        ("os._exit(0)", "ESTOP", 1),
        # SIGALRM without an alarm, SIGUSR1
        ("os.kill(os.getpid(), 14); os.kill(os.getpid(), 10); os.fork()", "IDLE", 0),
    ):
        (tmp_path / "mine.py").write_text(POLICY.format(act=act))
        done = python(*walk[1:], "1", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (status, "")
        assert figures(tmp_path)["final_state"] == state
        assert state in done.stdout
