"""Train, resume and export, as the command line does, with a named trainer or a user's own class."""

import ast
import io
import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import jax
import pytest
from import_in_process import import_in_process
from refused import refusal_of
from rich.console import Console
from shell import Shell

import footfall.train
from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.policies.learned import LearnedPolicy
from footfall.robots.description import Robot
from footfall.train import api, cluster
from footfall.train.api import TrainRequest
from footfall.train.compilation_cache import use_compilation_cache
from footfall.train.config import load_preset
from footfall.train.runs import checkpoint
from footfall.train.runs.display import Display
from footfall.train.runs.failure import FOLDER, REPORT, Failure
from footfall.train.runs.folder import Run, open_run
from footfall.train.trainers import TRAINERS

OWN = "own_trainer:StandingTrainer"


@pytest.fixture
def run(run: Run) -> Run:
    """A run of a trainer that computes nothing."""
    provenance = replace(run.provenance, trainer=OWN)
    (run.folder / "run.yaml").write_text(dump(provenance))
    return replace(run, provenance=provenance)


def test_a_new_run_folder_records_its_request(tmp_path: Path, go1: Robot) -> None:
    out = tmp_path / "mine"
    assert api.begin(TrainRequest("go1", "smoke", 9, out, 12345, 7.5, OWN)) == out
    smoke, opened = load_preset("smoke"), open_run(out)
    ppo = replace(smoke.ppo, total_steps=12345)
    assert opened.config == replace(smoke, ppo=ppo, checkpoint_interval_s=7.5)
    found = opened.provenance
    assert (found.robot, found.seed, found.preset, found.trainer) == ("go1", 9, "smoke", OWN)
    assert (found.robot_digest, found.device) == (go1.digest, jax.devices()[0].device_kind)
    assert {"jax", "tensordict", "mujoco"} <= set(found.versions)
    with pytest.raises(ValueError, match="seed"):
        TrainRequest(seed=-1)


def test_default_folder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own_folder: Path) -> None:
    monkeypatch.chdir(tmp_path)
    folder = api.begin(TrainRequest(robot=str(own_folder), preset="smoke", seed=3, trainer=OWN))
    assert folder.parent == Path("runs")
    assert folder.name.startswith("go1-smoke-3-20")
    opened = open_run(folder)
    assert (opened.provenance.robot, opened.config) == (str(own_folder), load_preset("smoke"))


def resumed(run: Run) -> str:
    text = io.StringIO()
    api.resume(run.folder, Display(1, Console(file=text, width=400)))
    return text.getvalue()


def test_a_run_counts_as_finished_only_with_last_checkpoint_and_policy(run: Run) -> None:
    last, earlier = (run.checkpoints / f"000000{iteration}.ckpt" for iteration in (16, 15))
    for remove in (lambda: None, lambda: last.rename(earlier).write_text("15"), run.policy.unlink):
        remove()
        assert "is finished" not in resumed(run)
        assert run.policy.is_file()
        assert "is finished" in resumed(run)


@pytest.mark.usefixtures("private_cache")
def test_a_user_without_a_home_trains_without_a_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in ("JAX_COMPILATION_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(Path, "home", Mock(side_effect=RuntimeError("Could not determine home directory.")))
    assert "HOME" in use_compilation_cache()


def test_a_cache_that_others_may_write_is_not_used(run: Run, private_cache: Path) -> None:
    run.checkpoints.mkdir()
    (run.checkpoints / "00000016.ckpt").touch()
    run.policy.touch()
    for mode, refused, entries in ((0o755, False, 1), (0o777, True, 0), (0o755, False, 1)):
        private_cache.chmod(mode)
        assert (f"others may write to {private_cache}" in resumed(run)) is refused
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
        jax.jit(lambda x: x * 12345.0).lower(1.0).compile()
        found = list(private_cache.glob("*-cache"))
        assert len(found) == entries
        for path in found:
            path.unlink()


def test_export_takes_the_last_checkpoint_or_the_given_one(run: Run, tmp_path: Path) -> None:
    with pytest.raises(UserError):
        api.export_run(run.folder)
    run.checkpoints.mkdir()
    for iteration in (2, 11):
        (run.checkpoints / f"{iteration:08d}.ckpt").write_text(str(iteration))
    assert api.export_run(run.folder) == (run.policy, 0.0)
    assert run.policy.is_file()
    out, given = tmp_path / "other.onnx", tmp_path / "a.ckpt"
    given.write_text("no number")
    with pytest.raises(ValueError, match="no number"):
        api.export_run(run.folder, out, given)
    assert not out.exists()
    given.write_text("5")
    assert api.export_run(run.folder, out, given) == (out, 0.0)
    assert out.is_file()


def test_several_processes_need_out_and_a_parallel_trainer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "processes", lambda: 2)
    with pytest.raises(UserError, match="--out"):
        api.begin(TrainRequest())
    with pytest.raises(UserError, match="StandingTrainer"):
        api.begin(TrainRequest(out=tmp_path / "x", trainer=OWN))


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


def test_a_class_without_a_trainers_methods_is_refused(tmp_path: Path) -> None:
    for name, message in (
        ("none", "no trainer 'none': give one of brax, rsl_rl, or MODULE:NAME of your own"),
        ("no_such_module:Trainer", "no module 'no_such_module'"),
        ("own_trainer:Missing", "no trainer 'own_trainer:Missing'"),
        ("own_trainer:NUMBER", "not a class"),
        ("own_trainer:Unrelated", "must derive from footfall.train.trainer.Trainer"),
        ("own_trainer:Incomplete", "implement restore, prepare, iterate, save, export"),
    ):
        request = api.TrainRequest(preset="smoke", trainer=name, out=tmp_path / "run")
        assert message in refusal_of(api.begin, request)
        assert not (tmp_path / "run").exists()


def test_modules_that_trainers_share_import_no_trainer() -> None:
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
