"""Trainers by name: those of footfall, one of which may be missing, and a user's own by MODULE:NAME."""

import ast
import sys
from pathlib import Path

import pytest
from import_in_process import import_in_process
from refused import refusal_of
from shell import Shell

import footfall.train
from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.policies.learned import LearnedPolicy
from footfall.robots.description import Robot
from footfall.train import api
from footfall.train.runs import checkpoint
from footfall.train.runs.failure import FOLDER, REPORT, Failure
from footfall.train.trainers import TRAINERS

OWN = "own_trainer:StandingTrainer"
LIBRARIES = ("brax", "rsl_rl", "torch", "footfall.train.brax", "footfall.train.rsl_rl")


def test_a_users_trainer_trains_resumes_and_exports(
    tmp_path: Path, go1: Robot, capsys: pytest.CaptureFixture[str]
) -> None:
    run = api.train(api.TrainRequest(preset="smoke", trainer=OWN, out=tmp_path / "run"))
    assert api.open_run(run).provenance.trainer == OWN
    assert LearnedPolicy(run / "policy.onnx", go1).contract.robot == "go1"
    kept = checkpoint.latest(run / "checkpoints")
    assert kept == run / "checkpoints" / "00000016.ckpt"
    assert "reward 16.00" in capsys.readouterr().out
    kept.rename(kept.with_name("00000009.ckpt")).write_text("9")
    api.resume(run)
    assert "resuming from 00000009.ckpt" in capsys.readouterr().out
    assert kept.read_text() == "16"
    opened = api.open_run(run)
    failure = Failure(1, "a reason", "cpu", {}, opened.provenance, opened.config)
    (run / FOLDER).mkdir()
    (run / FOLDER / REPORT).write_text(dump(failure))
    with pytest.raises(UserError, match="StandingTrainer"):
        api.diagnose(run, report=print)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("none", "no trainer 'none': give one of brax, rsl_rl, or MODULE:NAME of your own"),
        ("no_such_module:Trainer", "no module 'no_such_module'"),
        ("own_trainer:Missing", "no trainer 'own_trainer:Missing'"),
        ("own_trainer:NUMBER", "not a class"),
        ("own_trainer:Unrelated", "must derive from footfall.train.trainer.Trainer"),
        ("own_trainer:Incomplete", "implement restore, prepare, iterate, save, export"),
    ],
)
def test_a_class_without_a_trainers_methods_is_refused(name: str, message: str, tmp_path: Path) -> None:
    request = api.TrainRequest(preset="smoke", trainer=name, out=tmp_path / "run")
    assert message in refusal_of(api.begin, request)
    assert not (tmp_path / "run").exists()


def test_modules_for_every_trainer_import_no_trainer() -> None:
    folder = Path(footfall.train.__file__).parent
    for path in folder.rglob("*.py"):
        if path.relative_to(folder).parts[0] in TRAINERS:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import | ast.ImportFrom):
                module = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
                for name in (f"{module}{alias.name}." for alias in node.names):
                    assert not name.startswith(tuple(f"{lib}." for lib in LIBRARIES)), (path, name)


def test_training_with_brax_needs_no_torch() -> None:
    import_in_process(["footfall.train.api"], blocked=("torch", "rsl_rl", "tensordict"))


@pytest.mark.parametrize("missing", ["torch", "rsl_rl"])
def test_a_missing_extra_is_reported_in_one_line(
    tmp_path: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    loaded = [name for name in sys.modules if name.startswith((f"{missing}.", "footfall.train.rsl_rl"))]
    for name in loaded:  # by other tests of this process
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    command = ("train", "--preset", "smoke", "--trainer", "rsl_rl", "--out", tmp_path / "run")
    assert "[rsl-rl]'" in shell.refuses(*command)
    assert not (tmp_path / "run").exists()
