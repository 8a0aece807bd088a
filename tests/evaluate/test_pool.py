"""Tasks in parallel processes: each has an outcome, even if its process dies."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from footfall.common.errors import UserError
from footfall.evaluate.pool import run_all


def square(number: int) -> int:
    if number < 0:
        raise UserError("this number has no square")
    if number == 3:
        raise ArithmeticError("three is\ntoo much")
    if number == 5:
        os._exit(1)
    time.sleep(0.05)
    return number * number


def test_a_failed_task_is_reported_in_one_line_and_only_bad_input_ends_the_others() -> None:
    progress: list[int] = []
    outcomes = run_all(square, range(9), workers=2, on_finished=progress.append)
    assert [outcome.value for outcome in outcomes] == [0, 1, 4, None, 16, None, 36, 49, 64]
    assert [outcomes[k].error for k in (3, 5)] == ["ArithmeticError: three is too much", "its process died"]
    assert progress == [1, 2, 3, 4, 5, 6, 7, 8, 9]
    with pytest.raises(UserError, match="no square"):
        run_all(square, [-1, 2, 4], workers=1)


def test_variables_for_workers_are_removed_afterwards(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FOOTFALL_TEST", "before")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    monkeypatch.delenv("FOOTFALL_NEW", raising=False)
    given = {"FOOTFALL_TEST": "within", "FOOTFALL_NEW": "new", "OMP_NUM_THREADS": "3"}
    outcomes = run_all(os.getenv, [*given, "MKL_NUM_THREADS"], workers=1, environment=given)
    assert [outcome.value for outcome in outcomes] == ["within", "new", "3", "1"]
    assert os.environ["FOOTFALL_TEST"] == "before"
    assert not {"FOOTFALL_NEW", "MKL_NUM_THREADS"} & set(os.environ)


SCRIPT = """
import os, signal, sys, time
from pathlib import Path
from footfall.evaluate.pool import run_all

def task(seconds):
    Path(f"task-{os.getpid()}").touch()
    time.sleep(seconds)
    return seconds

if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    workers = int(sys.argv[2])
    try:
        outcomes = run_all(task, [float(sys.argv[1])] * workers, workers)
        print([(outcome.value, outcome.error) for outcome in outcomes])
    except KeyboardInterrupt:
        sys.exit(130)
else:
    Path(f"loading-{os.getpid()}").touch()
    time.sleep(0.5)
"""


@pytest.mark.parametrize(
    ("awaited", "seconds", "workers", "sent_signal", "ignored", "expected"),
    [
        ("loading", "300", 2, signal.SIGINT, False, (130, "", "")),
        ("task", "300", 1, signal.SIGTERM, False, (130, "", "")),
        # `footfall evaluate ... &` in a script shares the script's process group, and ignores SIGINT.
        ("task", "0.5", 1, signal.SIGINT, True, (0, "[(0.5, '')]\n", "")),
    ],
    ids=["Ctrl-C while processes load their modules", "SIGTERM", "Ctrl-C that the command ignores"],
)
def test_a_signal_ends_long_tasks_at_once_and_prints_nothing(
    tmp_path: Path, awaited: str, seconds: str, workers: int,
    sent_signal: signal.Signals, ignored: bool, expected: tuple[int, str, str],
) -> None:  # fmt: skip
    """Ctrl-C reaches the command's process group, as on a terminal; SIGTERM reaches the command alone."""
    (tmp_path / "script.py").write_text(SCRIPT)
    process = subprocess.Popen(
        [sys.executable, "script.py", seconds, str(workers)],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=(lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)) if ignored else None,  # noqa: PLW1509
    )  # fmt: skip
    try:
        deadline = time.monotonic() + 60
        while len(list(tmp_path.glob(f"{awaited}-*"))) < workers and time.monotonic() < deadline:
            time.sleep(0.01)
        (os.killpg if sent_signal == signal.SIGINT else os.kill)(process.pid, sent_signal)
        output = process.communicate(timeout=60)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert (process.returncode, *output) == expected
    if awaited == "task":
        assert len(list(tmp_path.glob("task-*"))) == 1  # the task ran once
