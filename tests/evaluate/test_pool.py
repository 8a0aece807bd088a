"""Tasks in parallel processes: none is lost, however its process ends."""

import os
import subprocess
import sys
import time
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
    outcomes = run_all(square, range(6), workers=2, done=progress.append)
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
