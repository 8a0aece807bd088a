"""`footfall train`, `export` and what follows, with the smoke preset."""

import json
import os
import shutil
import signal
from pathlib import Path

import pytest
from shell import Shell

from footfall.cli import main
from footfall.train.config import PRESETS

pytest.importorskip("jax")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of the smoke preset."""
    folder = tmp_path_factory.mktemp("runs") / "smoke"
    assert main(["train", "--robot", "go1", "--preset", "smoke", "--seed", "1", "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def copied_run(run_folder: Path, tmp_path: Path) -> Path:
    """The run, free to be damaged."""
    return Path(shutil.copytree(run_folder, tmp_path / "run"))


def test_the_policy_is_there_when_training_ends(run_folder: Path) -> None:
    assert (run_folder / "policy.onnx").is_file()
    assert (run_folder / "config.yaml").is_file()
    assert list((run_folder / "checkpoints").iterdir())


def test_the_finished_policy_has_walked_over_the_bus(run_folder: Path) -> None:
    evaluation = json.loads((run_folder / "evaluation.json").read_text())
    assert evaluation["scenarios"]["gentle"]["episodes"] > 0


def test_the_run_folder_is_a_policy(shell: Shell, run_folder: Path) -> None:
    outcome = shell("deploy", run_folder, "--duration", "0.2")
    assert outcome.status == 0, outcome.err  # too short to fall


def test_export_writes_the_same_policy_again(shell: Shell, run_folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "again.onnx"
    outcome = shell("export", run_folder, "--out", out)
    assert outcome.status == 0, outcome.err
    assert out.read_bytes() == (run_folder / "policy.onnx").read_bytes()


def test_training_into_the_same_folder_is_refused(shell: Shell, run_folder: Path) -> None:
    complaint = shell.refuses("train", "--preset", "smoke", "--out", run_folder)
    assert f"--resume {run_folder}" in complaint


@pytest.mark.parametrize("verb", [["train", "--resume"], ["export"]], ids=" ".join)
def test_a_damaged_checkpoint_is_named(shell: Shell, copied_run: Path, verb: list[str]) -> None:
    for path in (copied_run / "checkpoints").iterdir():
        path.write_bytes(b"garbage")
    policy = copied_run / "policy.onnx"
    policy.unlink()  # or there would be nothing left to train
    outcome = shell(*verb, copied_run)
    assert outcome.status == 2
    assert outcome.err.count("\n") == 1
    assert str(copied_run) in outcome.err
    assert not policy.exists()


def test_a_finished_run_is_neither_exported_nor_evaluated_again(shell: Shell, run_folder: Path) -> None:
    files = {path: path.stat().st_mtime_ns for path in run_folder.rglob("*")}
    outcome = shell("train", "--resume", run_folder)
    assert outcome.status == 0
    assert "is finished" in outcome.out
    assert {path: path.stat().st_mtime_ns for path in run_folder.rglob("*")} == files


def test_a_policy_that_was_written_since_it_walked_walks_again(
    shell: Shell, copied_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def walk(spec: str, *_: object, **__: object) -> dict[str, dict]:
        walked.append(spec)
        return {"scenarios": {}}

    walked: list[str] = []
    monkeypatch.setattr("footfall.evaluate.api.evaluate_policy", walk)
    os.utime(copied_run / "policy.onnx")
    assert shell("train", "--resume", copied_run).status == 0
    assert walked == [str(copied_run)]


@pytest.mark.parametrize(
    "option",
    [("--preset", "cpu"), ("--robot", "go1"), ("--seed", "0"), ("--trainer", "brax"), ("--steps", "9")],
)
def test_a_resumed_run_has_its_own_settings_even_where_they_are_the_default(
    shell: Shell, run_folder: Path, option: tuple[str, str]
) -> None:
    assert f"leave {option[0]} out" in shell.refuses("train", "--resume", run_folder, *option)


@pytest.mark.parametrize(
    ("line", "change", "complaint"),
    [
        (
            "actor_hidden_dims: [32, 32]",
            "actor_hidden_dims: [32, -3]",
            "actor_hidden_dims must be above 0, not -3",
        ),
        ("critic_hidden_dims: [32, 32]", "critic_hidden_dims: []", "need a hidden layer"),
        ("gamma: 0.97", "gamma: 1.7", "gamma must be from 0 to 1"),
        ("learning_rate: 1.0e-3", "learning_rate: .nan", "learning_rate"),
        ("learning_rate: 1.0e-3", "learning_rate: -1.0", "learning_rate must be above 0"),
        ("episode_s: 2.0", "episode_s: 1.0e-4", "shorter than a control step, 0.02 s"),
        ("forward_m_s: [-0.5, 0.5]", "forward_m_s: [0.5, -0.5]", "forward_m_s must be a range from low"),
        ("frequency_hz: 2.5", "frequency_hz: 0.0", "frequency_hz must be from 0.05 to 50"),
        ("interval_s: {low: 0.5", "interval_s: {low: -0.5", "low must be above 0"),
        ("checkpoint_interval_s: 2.0", "checkpoint_interval_s: -2.0", "must be 0 or above"),
    ],
)
def test_settings_that_cannot_work_are_refused_and_leave_no_folder(
    shell: Shell, tmp_path: Path, line: str, change: str, complaint: str
) -> None:
    smoke = (PRESETS / "smoke.yaml").read_text()
    assert line in smoke
    (tmp_path / "mine.yaml").write_text(smoke.replace(line, change, 1))
    out = tmp_path / "run"
    assert complaint in shell.refuses("train", "--preset", tmp_path / "mine.yaml", "--out", out)
    assert not out.exists()


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (("--coordinator", "junk", "--processes", "2", "--process", "0"), "expected HOST:PORT or auto"),
        (("--coordinator", "host:", "--processes", "2", "--process", "0"), "expected HOST:PORT or auto"),
        (
            ("--coordinator", "host:65536", "--processes", "2", "--process", "0"),
            "expected HOST:PORT or auto",
        ),
        (("--coordinator", "[::1]:12", "--processes", "2", "--process", "2"), "of 2 the last is 1"),
        (("--processes", "2"), "--coordinator HOST:PORT, --processes and --process"),
        (("--coordinator", "host:1", "--processes", "2"), "--coordinator HOST:PORT, --processes and"),
        (("--coordinator", "auto", "--process", "0", "--processes", "2"), "--coordinator HOST:PORT"),
    ],
)
def test_what_is_no_cluster_is_refused_before_anything_waits(
    shell: Shell, tmp_path: Path, options: tuple[str, ...], complaint: str
) -> None:
    assert complaint in shell.refuses("train", "--out", tmp_path / "run", *options)


def test_a_mistyped_folder_does_not_wait_for_the_device(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[str] = []
    monkeypatch.setattr("footfall.verbs.train.start_device", lambda: started.append("device"))
    assert "no run at" in shell.refuses("train", "--resume", tmp_path / "runn")
    assert not started


def test_sigterm_lets_a_verb_close_what_is_open(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[str] = []

    def verb(*_: object, **__: object) -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        finally:
            closed.append("pool")

    before = signal.getsignal(signal.SIGTERM)
    monkeypatch.setattr("footfall.cli.app", verb)
    outcome = shell("train")
    assert (outcome.status, outcome.err) == (143, "footfall: terminated\n")
    assert closed == ["pool"]
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.parametrize("file", ["run.yaml", "config.yaml"])
def test_a_damaged_run_folder_is_named(shell: Shell, copied_run: Path, file: str) -> None:
    (copied_run / file).write_text("garbage")
    assert file in shell.refuses("export", copied_run)
