"""A failing training ends in one line, with its last good checkpoint; a replay names the first bad value."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import jax
import numpy as np
import pytest
from refused import refusal_of
from shell import Shell

from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.robots.description import load_robot
from footfall.train import api
from footfall.train.brax.diagnosis import broken_rows
from footfall.train.brax.parts import assemble
from footfall.train.brax.trainer import BraxTrainer
from footfall.train.runs import checkpoint, failure
from footfall.train.runs.failure import FOLDER, TrainingFailedError, failure_of
from footfall.train.runs.folder import Run

pytestmark = pytest.mark.usefixtures("kept_programs")


@pytest.fixture(scope="module")
def sound(whole_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of a run without faults, which a test may damage."""
    return Path(shutil.copytree(whole_run, tmp_path_factory.mktemp("runs") / "sound"))


def test_metrics_that_are_not_finite_or_of_diverged_simulations_are_a_failure() -> None:
    healthy = {"learning/total_loss": 0.1, "learning/gradient_norm": 0.5, "episode/diverged": 0.01}
    assert failure_of(healthy, diverged_limit=0.01) is None
    assert "2.00%" in str(failure_of(healthy | {"episode/diverged": 0.02}, diverged_limit=0.01))
    for name in healthy:
        for value in (np.nan, np.inf, -np.inf):
            assert failure_of(healthy | {name: value}, diverged_limit=0.01) == f"{name} is not finite"


def test_values_that_are_not_finite_are_found_by_name_and_by_environment() -> None:
    tree = {"good": np.ones(2), "count": np.int32(3), "bad": {"deep": np.array([0.0, np.nan])}}
    assert failure.non_finite_leaves(tree) == ["['bad']['deep']"]
    values = np.array([[1.0, 2.0], [np.nan, 2.0], [1.0, np.inf]])
    np.testing.assert_array_equal(broken_rows(values), [False, True, True])


def test_files_for_a_replay_are_left(run: Run) -> None:
    folder = run.folder / FOLDER
    for made in (run.checkpoints, folder):
        made.mkdir()
    (run.checkpoints / "00000006.ckpt").write_bytes(b"good")
    for old in ("00000002.ckpt", "environment.npz"):
        (folder / old).touch()
    error = failure.record_failure(run, TrainingFailedError(7, "a is not finite"), can_diagnose=True)
    for named in ("iteration 7: a is not finite", "00000006.ckpt", f"footfall diagnose {run.folder}"):
        assert named in str(error)
    assert sorted(path.name for path in folder.iterdir()) == ["00000006.ckpt", failure.REPORT]
    assert (folder / "00000006.ckpt").read_bytes() == b"good"
    left = failure.read_failure(folder / failure.REPORT)
    assert (left.iteration, left.reason, left.devices) == (7, "a is not finite", len(jax.devices()))
    assert (left.provenance, left.config) == (run.provenance, run.config)
    assert {"source revision", "jax"} <= set(left.versions)


@pytest.mark.parametrize(
    ("field", "at", "value", "limit", "named"),
    [
        ("qvel", (17, 6), np.nan, 0.001, ("environment 17, control step 1 of 8", "qpos, qvel", "1 of 32")),
        ("command", 9, 1e30, 0.01, ("environment 9, control step 1 of 8", "tracking/linear_error_m_s")),
    ],
)
def test_the_cause_is_found_by_a_replay(
    sound: Path, tmp_path: Path, field: str, at: Any, value: float, limit: float, named: tuple[str, ...]
) -> None:
    """A sound run, whose state after the second iteration is replaced by a damaged one, is resumed."""
    folder = Path(shutil.copytree(sound, tmp_path / "run"))
    shutil.rmtree(folder / FOLDER, ignore_errors=True)
    run = api.open_run(folder)
    write_atomically(folder / "config.yaml", dump(replace(run.config, diverged_limit=limit)).encode())
    kept, *others = sorted(run.checkpoints.iterdir())
    state, seen = checkpoint.restore(kept, assemble(run.config, load_robot("go1")).shapes)
    for path in others:
        path.unlink()
    damaged = np.array(getattr(state.env, field))
    damaged[at] = value
    damaged_state = state._replace(env=state.env._replace(**{field: damaged}))
    checkpoint.save(run.checkpoints, int(state.iteration), damaged_state, seen)
    with pytest.raises(UserError, match=r"iteration \d"):
        api.resume(folder)
    found = api.diagnose(folder, report=lambda _: None)
    assert found.reason == found.failure.reason
    assert [words for words in named if words not in found.finding] == []
    with np.load(found.saved) as saved:
        assert (saved["state.qpos"].shape, saved["action"].shape) == ((19,), (12,))
        assert f"environment {saved['environment']}," in found.finding
        assert "state.sample.friction" in saved


def test_a_run_without_a_failure_has_nothing_to_replay(sound: Path, shell: Shell) -> None:
    assert str(sound) in shell.refuses("diagnose", sound)


def test_a_state_that_is_not_finite_is_never_saved(sound: Path, tmp_path: Path) -> None:
    run = api.open_run(Path(shutil.copytree(sound, tmp_path / "run")))
    before = checkpoint.latest(run.checkpoints)
    trainer = BraxTrainer(run, load_robot("go1"))
    trainer.iteration, trainer._state = 7, {"mean": np.array([0.0, np.nan])}  # type: ignore[assignment]
    with pytest.raises(TrainingFailedError, match=r"iteration 7: \['mean'\]"):
        trainer.save()
    assert checkpoint.latest(run.checkpoints) == before


def test_a_lost_device_is_reported_in_one_line_and_an_unexpected_exception_with_a_traceback(
    sound: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = "INTERNAL: CUDA_ERROR_ECC_UNCORRECTABLE\nstack\nstack"
    unexpected = "INTERNAL: CpuCallback error: Traceback (most recent call last): ..."
    errors = map(jax.errors.JaxRuntimeError, (text, unexpected))
    monkeypatch.setattr(BraxTrainer, "prepare", Mock(side_effect=errors))
    (sound / "policy.onnx").unlink(missing_ok=True)  # or there would be nothing left to do
    message = refusal_of(api.resume, sound)
    for named in ("CUDA_ERROR_ECC_UNCORRECTABLE", "00000006.ckpt", f"footfall train --resume {sound}"):
        assert named in message
    assert (sound / FOLDER / "device_error.txt").read_text() == text
    with pytest.raises(jax.errors.JaxRuntimeError):
        api.resume(sound)


def test_a_failing_back_end_is_reported_in_one_line(sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    error = RuntimeError("Unable to initialize backend 'cuda': no device\nmore")
    monkeypatch.setattr(jax, "devices", Mock(side_effect=error))
    for use in (api.resume, api.export_run):
        assert "'cuda'" in refusal_of(use, sound)
