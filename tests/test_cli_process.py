"""The installed command, in a process of its own: what only a real process shows."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

FOOTFALL = [sys.executable, "-m", "footfall"]

VERBS = (
    "train", "sweep", "watch", "evaluate", "export", "deploy", "compare", "replay", "log", "demo", "diagnose",
    "doctor",
)  # fmt: skip


def run(*tokens: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*FOOTFALL, *tokens], capture_output=True, text=True, check=False, **options)


def test_help_names_every_verb_and_loads_no_room() -> None:
    code = (
        "import sys; from footfall.cli import main; main(['--help']);"
        "print([m for m in ('jax', 'mujoco', 'onnxruntime', 'can', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    for verb in VERBS:
        assert f" {verb} " in done.stdout
    assert done.stdout.rstrip().endswith("[]")


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself(verb: str) -> None:
    done = run(verb, "--help")
    assert done.returncode == 0
    assert f"footfall {verb}" in done.stdout


def test_version() -> None:
    done = run("--version")
    assert done.returncode == 0
    assert done.stdout.strip().count(".") == 2


@pytest.mark.parametrize(
    "tokens",
    [["walk"], ["deploy", "rex"], ["deploy", "stand", "--command", "0.5,0"], ["train", "--preset", "huge"]],
    ids=" ".join,
)
def test_bad_input_is_one_line_and_status_2(tokens: list[str], tmp_path: Path) -> None:
    done = run(*tokens, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("footfall: ")
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


def test_deploy_needs_no_learning_library(tmp_path: Path) -> None:
    blocker = tmp_path / "sitecustomize.py"
    blocker.write_text(
        "import sys\n"
        "class Blocker:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in {'jax', 'jaxlib', 'torch', 'brax', 'flax', 'onnx'}:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Blocker())\n"
    )
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = run("deploy", "stand", "--duration", "0.2", env=environment, cwd=Path(__file__).parents[1])
    assert done.returncode == 0, done.stderr
    refused = run("train", "--preset", "smoke", env=environment, cwd=Path(__file__).parents[1])
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert "[train]'" in refused.stderr


def test_ctrl_c_ends_a_run_without_a_traceback(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [*FOOTFALL, "deploy", "stand", "--realtime", "--duration", "60", "--json", str(tmp_path / "a.json")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(4.0)
    process.send_signal(signal.SIGINT)
    _, complaint = process.communicate(timeout=20)
    assert "Traceback" not in complaint
    assert process.returncode in {0, 1, 130}


def test_a_reader_that_leaves_is_no_error() -> None:
    process = subprocess.Popen(
        [*FOOTFALL, "deploy", "--help"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert "Traceback" not in process.stderr.read()
    process.wait(timeout=20)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full")
def test_a_full_disk_is_one_line() -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*FOOTFALL, "deploy", "stand", "--duration", "0.1"],
            stdout=full, stderr=subprocess.PIPE, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 2
    assert done.stderr.startswith("footfall: ")
    assert done.stderr.count("\n") == 1


def test_doctor_looks_at_everything_and_never_fails() -> None:
    done = run("doctor")
    assert done.returncode == 0, done.stderr
    for what in (
        "processors", "packages", "simulators", "accelerator", "offscreen rendering",
        "compilation cache", "CAN interfaces", "real-time", "memory locking",
    ):  # fmt: skip
        assert what in done.stdout
