"""The installed command as a process: behaviour that only a real process shows."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOOTFALL = [sys.executable, "-m", "footfall"]


def run(*tokens: str, **options) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*FOOTFALL, *tokens], capture_output=True, text=True, check=False, **options)


def test_the_api_and_help_import_no_large_library() -> None:
    code = (
        "import sys, footfall; assert 'numpy' not in sys.modules;"
        "from footfall.cli import main; main(['--help']);"
        "print([m for m in ('jax', 'mujoco', 'onnxruntime', 'can', 'matplotlib') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.rstrip().endswith("[]")


def test_ctrl_c_while_modules_are_loaded_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "cyclopts.py").write_text("raise KeyboardInterrupt")
    done = run("list", env=os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"})
    assert (done.returncode, done.stderr) == (130, "footfall: interrupted\n")


def test_deploy_needs_no_learning_library(tmp_path: Path) -> None:
    """Both commands run in one process.

    Deploy works without these libraries, and train names the missing extra.
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
    code = f"from footfall.cli import main; print([main(each) for each in {commands!r}])"
    variables = os.environ | {"PYTHONPATH": str(tmp_path)}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=variables, cwd=ROOT)
    assert done.stdout.splitlines()[-1] == "[0, 2]"
    assert done.stderr.count("\n") == 1
    assert "[train]'" in done.stderr


def test_an_interrupted_command_leaves_its_compiler_behind() -> None:
    code = (
        "import sys, time; from concurrent.futures import ThreadPoolExecutor as Pool; "
        "from footfall import __main__, cli; from footfall.common.in_time import COMPILING; "
        "Pool(1, COMPILING).submit(time.sleep, 300); "
        "cli.main = lambda: print('stopped') or 143; sys.exit(__main__.main())"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
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
