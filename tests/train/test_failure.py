"""Failing trainings: one clear line, the last good checkpoint intact, and a replay that names the culprit."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from long_tests import long_test
from shell import Shell
from small_disk import fill

from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.robots.description import load_robot
from footfall.train import api, cluster
from footfall.train.brax.diagnosis import broken_rows
from footfall.train.brax.parts import assemble
from footfall.train.brax.trainer import BraxTrainer
from footfall.train.runs import checkpoint
from footfall.train.runs.diagnosis import Diagnosis, differences
from footfall.train.runs.failure import (
    FOLDER,
    REPORT,
    SOURCE,
    TrainingFailedError,
    device_failures,
    failure_of,
    non_finite_leaves,
    read_failure,
    record_failure,
)
from footfall.train.runs.folder import Run
from footfall.train.runs.journal import Journal

pytestmark = pytest.mark.usefixtures("kept_programs")

ITERATIONS = 6
HEALTHY = {"learning/total_loss": 0.1, "learning/gradient_norm": 0.5, "episode/diverged": 0.0}


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


@pytest.fixture(scope="module")
def sound(whole_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of a run without faults, which a test may damage."""
    return Path(shutil.copytree(whole_run, tmp_path_factory.mktemp("runs") / "sound"))


class TestNoticing:
    def test_any_metric_that_is_not_finite_is_named(self) -> None:
        assert failure_of(HEALTHY, diverged_limit=0.01) is None
        for name in HEALTHY:
            for value in (np.nan, np.inf, -np.inf):
                assert failure_of(HEALTHY | {name: value}, diverged_limit=0.01) == f"{name} is not finite"

    def test_simulations_may_diverge_up_to_the_limit(self) -> None:
        assert failure_of(HEALTHY | {"episode/diverged": 0.01}, diverged_limit=0.01) is None
        reason = failure_of(HEALTHY | {"episode/diverged": 0.02}, diverged_limit=0.01)
        assert reason is not None
        assert reason.startswith("2.00% of the control steps ended in a diverged simulation")

    def test_many_names_stay_one_line(self) -> None:
        reason = failure_of({f"m{k}": np.nan for k in range(9)}, diverged_limit=0.01)
        assert reason == "m0, m1, m2, m3 and 5 more are not finite"

    def test_the_culprit_in_a_state_is_named(self) -> None:
        tree = {"good": np.ones(2), "count": np.int32(3), "bad": {"deep": np.array([0.0, np.nan])}}
        assert non_finite_leaves(tree) == ["['bad']['deep']"]


def test_one_number_that_is_not_finite_breaks_an_environment() -> None:
    values = np.array([[1.0, 2.0], [np.nan, 2.0], [1.0, np.inf]])
    np.testing.assert_array_equal(broken_rows(values), [False, True, True])


class TestReports:
    def test_files_for_a_replay_are_left(self, run: Run) -> None:
        run.checkpoints.mkdir()
        (run.checkpoints / "00000006.ckpt").write_bytes(b"good")
        folder = run.folder / "failure"
        folder.mkdir()
        for old in ("00000002.ckpt", "environment.npz"):
            (folder / old).touch()
        error = record_failure(run, TrainingFailedError(7, "a is not finite"), can_diagnose=True)
        assert str(error) == (
            "training failed in iteration 7: a is not finite; the last good checkpoint is 00000006.ckpt;"
            f" find the cause with: footfall diagnose {run.folder}"
        )
        assert sorted(path.name for path in folder.iterdir()) == ["00000006.ckpt", "failure.yaml"]
        assert (folder / "00000006.ckpt").read_bytes() == b"good"
        left = read_failure(folder / "failure.yaml")
        assert (left.iteration, left.reason, left.devices) == (7, "a is not finite", len(jax.devices()))
        assert (left.provenance, left.config) == (run.provenance, run.config)
        assert {"source revision", "jax"} <= set(left.versions)

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("RESOURCE_EXHAUSTED: no",
            "out of memory; the last good checkpoint is none; start a new run with a smaller"),
            ("CUDA Out of Memory", "out of memory"),
            ("lost it\nmore",
            "the device failed: lost it; the last good checkpoint is none; continue with: footfall go "),
        ],
    )  # fmt: skip
    def test_a_failing_device_is_one_line_and_its_text_kept(self, run: Run, text: str, said: str) -> None:
        with pytest.raises(UserError) as caught, device_failures(run, (ValueError,), verb="go"):
            raise ValueError(text)
        assert said in str(caught.value)
        assert str(run.folder) in str(caught.value)
        assert (run.folder / "failure" / "device_error.txt").read_text() == text


class TestReplay:
    """A sound run whose state is damaged between two iterations, which then fails."""

    def fail(self, sound: Path, folder: Path, damage: Callable[[Any], Any], limit: float = 0.01) -> str:
        """Damage the checkpoint after the second iteration and resume; returns the message."""
        run_folder = Path(shutil.copytree(sound, folder / "run"))
        shutil.rmtree(run_folder / FOLDER, ignore_errors=True)
        run = api.open_run(run_folder)
        write_atomically(run_folder / "config.yaml", dump(replace(run.config, diverged_limit=limit)).encode())
        shapes = assemble(run.config, load_robot("go1")).shapes
        kept = sorted(run.checkpoints.iterdir())[0]
        state, seen = checkpoint.restore(kept, shapes)
        for path in run.checkpoints.iterdir():
            path.unlink()
        checkpoint.save(run.checkpoints, int(state.iteration), damage(state), seen)
        with pytest.raises(UserError) as error:
            api.resume(run_folder)
        return str(error.value)

    def replay(self, folder: Path) -> Diagnosis:
        found = api.diagnose(folder / "run", say=lambda _: None)
        assert found.reason == found.failure.reason
        return found

    @long_test
    def test_a_gradient_that_overflows(self, sound: Path, tmp_path: Path, shell: Shell) -> None:
        def damage(state: Any) -> Any:
            value = jax.tree.map(lambda x: x * np.float32(1e12), state.params.value)
            return state._replace(params=state.params.replace(value=value))

        message = self.fail(sound, tmp_path, damage)
        run = tmp_path / "run"
        assert "\n" not in message
        assert message.startswith("training failed in iteration 5: ")
        assert "the last good checkpoint is 00000004.ckpt" in message
        assert message.endswith(f"footfall diagnose {run}")
        newest = checkpoint.latest(run / "checkpoints")
        assert newest is not None
        assert newest.name == "00000004.ckpt"
        assert not any((run / "checkpoints").glob("0000000[56]*"))

        shutil.rmtree(run / "checkpoints")  # the dump needs nothing else
        outcome = shell("diagnose", run)
        assert outcome.status == 0, outcome.err
        assert "replaying iteration 5 from 00000004.ckpt" in outcome.out
        assert "first: the rollout is finite; update, epoch 1, mini-batch 1: " in outcome.out

    def test_a_simulation_that_diverges(self, sound: Path, tmp_path: Path) -> None:
        def damage(state: Any) -> Any:
            qvel = np.array(state.env.qvel)
            qvel[17, 6] = np.nan
            return state._replace(env=state.env._replace(qvel=qvel))

        # Training refuses to save such a checkpoint, so the test writes it directly.
        message = self.fail(sound, tmp_path, damage, limit=0.001)
        assert "0.39% of the control steps ended in a diverged simulation" in message
        found = self.replay(tmp_path)
        assert found.finding.startswith(
            "environment 17, control step 1 of 8: the simulation diverged; after it qpos, qvel"
        )
        assert found.finding.endswith("(1 of 32 environments in this step)")

    def test_a_figure_that_overflows(self, sound: Path, tmp_path: Path) -> None:
        def damage(state: Any) -> Any:
            command = np.array(state.env.command)
            command[9] = 1e30
            return state._replace(env=state.env._replace(command=command))

        self.fail(sound, tmp_path, damage)
        found = self.replay(tmp_path)
        assert "environment 9, control step 1 of 8: tracking/linear_error_m_s is not finite" in found.finding
        assert found.saved is not None
        with np.load(found.saved) as saved:
            assert saved["state.command"][0] == np.float32(1e30)
            assert saved["state.qpos"].shape == (19,)
            assert saved["action"].shape == (12,)
            assert saved["environment"] == 9
            assert "state.sample.friction" in saved

    def test_a_run_without_a_failure_has_nothing_to_replay(self, sound: Path, shell: Shell) -> None:
        assert "holds no failed training" in shell.refuses("diagnose", sound)


def broken_trainer(run: Run) -> BraxTrainer:
    """A trainer after its seventh iteration, which left a non-finite value."""
    trainer = BraxTrainer(run, load_robot("go1"))
    trainer.iteration, trainer._state = 7, {"mean": np.array([0.0, np.nan])}  # type: ignore[assignment]
    return trainer


def test_a_state_that_is_not_finite_is_never_saved(sound: Path, tmp_path: Path) -> None:
    """Even if no metric shows it."""
    run = api.open_run(Path(shutil.copytree(sound, tmp_path / "run")))
    before = checkpoint.latest(run.checkpoints)
    with pytest.raises(TrainingFailedError, match=r"in iteration 7: \['mean'\] is not finite"):
        broken_trainer(run).save()
    assert checkpoint.latest(run.checkpoints) == before


def test_only_the_main_process_writes_a_report(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "is_main_process", lambda: False)
    before = sorted(run.folder.iterdir())
    error = record_failure(run, TrainingFailedError(7, "a is not finite"), can_diagnose=True)
    assert str(error).endswith("a is not finite; see process 0")
    assert sorted(run.folder.iterdir()) == before


def test_differences_since_a_failure_are_listed(run: Run) -> None:
    record_failure(run, TrainingFailedError(7, "a is not finite"), can_diagnose=True)
    failure = read_failure(run.folder / FOLDER / REPORT)
    assert differences(failure, failure.device, 1) == []
    older = replace(failure, devices=2, versions=failure.versions | {"jax": "0.1", SOURCE: "0f1e2d"})
    assert differences(older, "another", 1) == [
        f"device {failure.device}, now another",
        "device count 2, now 1",
        f"jax 0.1, now {failure.versions['jax']}",
        f"source revision 0f1e2d, now {failure.versions[SOURCE]}",
    ]


class TestDevice:
    def fail(self, sound: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> str:
        """The message of a training whose device fails with this text."""

        def failing(*_: Any) -> None:
            raise jax.errors.JaxRuntimeError(text)

        monkeypatch.setattr(BraxTrainer, "prepare", failing)
        (sound / "policy.onnx").unlink(missing_ok=True)  # or there would be nothing left to do
        with pytest.raises(UserError) as error:
            api.resume(sound)
        assert "\n" not in str(error.value)
        return str(error.value)

    def test_its_loss_ends_in_one_line(self, sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        text = "INTERNAL: CUDA_ERROR_ECC_UNCORRECTABLE\nstack\nstack"
        assert self.fail(sound, monkeypatch, text) == (
            "the device failed: INTERNAL: CUDA_ERROR_ECC_UNCORRECTABLE;"
            " the last good checkpoint is 00000006.ckpt;"
            f" continue with: footfall train --resume {sound}"
        )
        assert (sound / FOLDER / "device_error.txt").read_text() == text

    def test_a_failing_back_end_is_one_line(self, sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def failing() -> None:
            raise RuntimeError("Unable to initialize backend 'cuda': no device\nmore")

        monkeypatch.setattr(jax, "devices", failing)
        for use in (api.resume, api.export_run):
            with pytest.raises(UserError) as error:
                use(sound)
            assert (
                str(error.value) == "no device to compute on: Unable to initialize backend 'cuda': no device"
            )

    def test_its_own_defect_has_a_traceback(self, sound: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        text = "INTERNAL: CpuCallback error: Traceback (most recent call last): ..."
        with pytest.raises(jax.errors.JaxRuntimeError):
            self.fail(sound, monkeypatch, text)


class TestFullDisk:
    def test_training_continues_and_saves_later(
        self,
        disk: Path,
        six_iterations: str,
        capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        record = Journal.log

        def filling(self: Any, iteration: int, figures: Any) -> None:
            if iteration == 2:
                fill(disk)
            if iteration == 5:
                (disk / "filler").unlink()
            record(self, iteration, figures)

        monkeypatch.setattr(Journal, "log", filling)
        run = api.train(api.TrainRequest(preset=six_iterations, seed=5, out=disk / "run"))
        said = capsys.readouterr().out
        assert said.count("cannot write checkpoint") == 1
        assert said.count("cannot write") == said.count("training continues and tries again") == 2
        assert checkpoint.latest(run / "checkpoints") == run / "checkpoints" / "00000006.ckpt"
        assert (run / "policy.onnx").is_file()
        steps = [json.loads(line)["step"] for line in (run / "metrics.jsonl").read_text().splitlines()]
        assert steps[-1] == ITERATIONS * 256

    def test_a_full_disk_ends_the_training_with_a_message(
        self, disk: Path, six_iterations: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        record = Journal.log

        def filling(self: Any, iteration: int, figures: Any) -> None:
            if iteration == 2:
                fill(disk)
            record(self, iteration, figures)

        monkeypatch.setattr(Journal, "log", filling)
        with pytest.raises(UserError, match="No space left on device; the last good one is 00000001"):
            api.train(api.TrainRequest(preset=six_iterations, seed=5, out=disk / "run"))
        monkeypatch.undo()
        (disk / "filler").unlink()
        assert (api.resume(disk / "run") / "policy.onnx").is_file()
