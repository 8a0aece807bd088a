"""Tasks in parallel processes: none is lost, however its process ends."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from footfall.common.errors import UserError
from footfall.evaluate.pool import run_all


def square(number: int) -> int:
    return number * number


def square_unless_three(number: int) -> int:
    if number == 3:
        raise ArithmeticError("three is\ntoo much")
    return number * number


def die_at_three(number: int) -> int:
    if number == 3:
        os._exit(1)
    time.sleep(0.05)
    return number * number


def complain(_: int) -> int:
    raise UserError("this plant has no legs")


def test_outcomes_come_in_the_order_of_the_tasks() -> None:
    progress: list[int] = []
    outcomes = run_all(square, range(6), workers=2, on_finished=progress.append)
    assert [outcome.value for outcome in outcomes] == [0, 1, 4, 9, 16, 25]
    assert progress == [1, 2, 3, 4, 5, 6]


def test_a_task_that_raises_is_reported_in_one_line_and_the_others_finish() -> None:
    outcomes = run_all(square_unless_three, range(5), workers=2)
    assert outcomes[3].error == "ArithmeticError: three is too much"
    assert [outcome.value for outcome in outcomes] == [0, 1, 4, None, 16]


def test_a_killed_process_loses_only_its_own_task() -> None:
    outcomes = run_all(die_at_three, range(6), workers=2)
    assert outcomes[3].error == "its process died"
    assert [outcome.value for outcome in outcomes] == [0, 1, 4, None, 16, 25]


def test_bad_input_is_reported_to_the_user() -> None:
    with pytest.raises(UserError, match="no legs"):
        run_all(complain, range(3), workers=1)


def variable(name: str) -> str | None:
    return os.environ.get(name)


def test_variables_for_workers_are_removed_afterwards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FOOTFALL_TEST", "before")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    monkeypatch.delenv("FOOTFALL_NEW", raising=False)
    given = {"FOOTFALL_TEST": "within", "FOOTFALL_NEW": "new", "OMP_NUM_THREADS": "3"}
    outcomes = run_all(variable, [*given, "MKL_NUM_THREADS"], workers=1, environment=given)
    assert [outcome.value for outcome in outcomes] == ["within", "new", "3", "1"]
    assert os.environ["FOOTFALL_TEST"] == "before"
    assert not {"FOOTFALL_NEW", "MKL_NUM_THREADS"} & set(os.environ)


INTERRUPTED = """
import os, signal, sys, threading, time
from pathlib import Path
from footfall.evaluate.pool import run_all

def task(number):
    return number

if __name__ == "__main__":
    def interrupt():
        while len(list(Path().glob("loading-*"))) < 2:  # before that Python itself is starting
            time.sleep(0.01)
        os.killpg(0, signal.SIGINT)
    threading.Thread(target=interrupt).start()
    try:
        run_all(task, [1, 2], 2)
    except KeyboardInterrupt:
        sys.exit(130)
else:
    Path(f"loading-{os.getpid()}").touch()
    time.sleep(0.5)
"""


def test_ctrl_c_while_processes_load_their_modules_prints_nothing(tmp_path: Path) -> None:
    """The command runs in its own process group, as in a terminal, where Ctrl-C reaches all processes."""
    (tmp_path / "script.py").write_text(INTERRUPTED)
    command = [sys.executable, "script.py"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, check=False, start_new_session=True
    )
    assert (done.returncode, done.stderr) == (130, "")


SIGNALLED = """
import os, signal, sys, time
from pathlib import Path
from footfall.evaluate.pool import run_all

def task(seconds):
    Path(f"task-{os.getpid()}").touch()
    time.sleep(seconds)
    return seconds

def interrupt(*_):
    raise KeyboardInterrupt

if __name__ == "__main__":
    signal.signal(signal.SIGTERM, interrupt)
    try:
        print([(outcome.value, outcome.error) for outcome in run_all(task, [float(sys.argv[1])], 1)])
    except KeyboardInterrupt:
        sys.exit(143)
"""


def signalled(
    folder: Path, seconds: float, order: Callable[[int], None], ignore: bool
) -> tuple[int, str, int]:
    """Exit status and output of a pool that gets a signal during its task, and how often the task began."""
    (folder / "script.py").write_text(SIGNALLED)
    process = subprocess.Popen(
        [sys.executable, "script.py", str(seconds)], cwd=folder, stdout=subprocess.PIPE, text=True,
        start_new_session=True,
        preexec_fn=(lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)) if ignore else None,  # noqa: PLW1509
    )  # fmt: skip
    try:
        deadline = time.monotonic() + 60
        while not list(folder.glob("task-*")) and time.monotonic() < deadline:
            time.sleep(0.02)
        order(process.pid)
        output, _ = process.communicate(timeout=60)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    return process.returncode, output, len(list(folder.glob("task-*")))


def test_sigterm_to_the_command_ends_a_long_task_at_once(tmp_path: Path) -> None:
    began = time.monotonic()
    status, _, _ = signalled(tmp_path, 300.0, lambda pid: os.kill(pid, signal.SIGTERM), ignore=False)
    assert status == 143
    assert time.monotonic() - began < 60


def test_ctrl_c_disturbs_no_worker_of_a_command_that_ignores_it(tmp_path: Path) -> None:
    """A script's `footfall evaluate ... &` shares the script's process group, and ignores SIGINT."""
    status, output, starts = signalled(tmp_path, 0.5, lambda pid: os.killpg(pid, signal.SIGINT), ignore=True)
    assert (status, output, starts) == (0, "[(0.5, '')]\n", 1)
