"""`footfall train`, `export` and what follows, with the smoke preset."""

import json
import shutil
from pathlib import Path

import pytest
from shell import Shell

from footfall.cli import main

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
    assert shell("deploy", run_folder, "--duration", "0.2").status in {0, 1}


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
    before = (copied_run / "policy.onnx").read_bytes()
    outcome = shell(*verb, copied_run)
    assert outcome.status == 2
    assert outcome.err.count("\n") == 1
    assert str(copied_run) in outcome.err
    assert (copied_run / "policy.onnx").read_bytes() == before


def test_a_mistyped_folder_does_not_wait_for_the_device(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[str] = []
    monkeypatch.setattr("footfall.verbs.train.start_device", lambda: started.append("device"))
    assert "no run at" in shell.refuses("train", "--resume", tmp_path / "runn")
    assert not started


@pytest.mark.parametrize("file", ["run.yaml", "config.yaml"])
def test_a_damaged_run_folder_is_named(shell: Shell, copied_run: Path, file: str) -> None:
    (copied_run / file).write_text("garbage")
    assert file in shell.refuses("export", copied_run)
