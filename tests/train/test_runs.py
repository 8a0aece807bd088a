"""Runs: the same seed gives the same result, a killed run resumes exactly, and each names its source."""

import itertools
import json
import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from edited import edit
from refused import refusal_of

from footfall.common import files
from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.locomotion import LocomotionEnv
from footfall.policies.learned import LearnedPolicy
from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.description import Robot
from footfall.train import api
from footfall.train.runs import checkpoint, provenance
from footfall.train.runs.failure import FOLDER, REPORT, Failure
from footfall.train.runs.folder import create_run, locked, trained_robot

pytestmark = pytest.mark.usefixtures("kept_programs")


def last_checkpoint(run: Path) -> bytes:
    return checkpoint.latest(run / "checkpoints").read_bytes()


def test_the_same_seed_gives_the_same_bits_and_a_killed_run_resumes_to_them(
    six_iterations: str, whole_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Killed before a file is renamed, a run still has the earlier state.

    The run is killed at its first checkpoint, which is rename 3 after two files of settings, and at its last.
    """
    replace_file, renames, again = os.replace, itertools.count(1), tmp_path / "again"
    left = {3: tmp_path / "at the first", 8: tmp_path / "at the last"}

    def rename(*names: Path) -> None:
        if folder := left.get(next(renames)):
            shutil.copytree(again, folder)
        replace_file(*names)

    with monkeypatch.context() as patch:
        patch.setattr(files.os, "replace", rename)
        api.train(api.TrainRequest(preset=six_iterations, seed=5, out=again))
    assert checkpoint.latest(left[3] / "checkpoints") is None
    for run in left.values():
        assert not (run / "policy.onnx").exists()
        api.resume(run)
    for run in (again, *left.values()):
        assert last_checkpoint(run) == last_checkpoint(whole_run)
        assert (run / "policy.onnx").read_bytes() == (whole_run / "policy.onnx").read_bytes()
        logs = ((each / "metrics.jsonl").read_text().splitlines() for each in (run, whole_run))
        steps, expected = ([json.loads(line)["step"] for line in log] for log in logs)
        assert steps == expected


def test_a_finished_run_is_not_changed_and_a_lost_policy_is_exported_again(
    whole_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = api.open_run(Path(shutil.copytree(whole_run, tmp_path / "run")))
    began = replace(run.provenance, device="NVIDIA H100", revision="0f1e2d")
    (run.folder / "run.yaml").write_text(dump(began))
    before = {path: path.stat().st_mtime_ns for path in run.folder.rglob("*")}
    api.resume(run.folder)
    assert "is finished" in capsys.readouterr().out
    assert {path: path.stat().st_mtime_ns for path in run.folder.rglob("*")} == before

    run.policy.unlink()
    api.resume(run.folder)
    printed = capsys.readouterr().out
    for began_with in ("NVIDIA H100", "0f1e2d, now "):
        assert began_with in printed
    assert last_checkpoint(run.folder) == last_checkpoint(whole_run)
    assert run.policy.read_bytes() == (whole_run / "policy.onnx").read_bytes()


def test_a_users_robot_is_found_again_and_refused_if_it_was_changed_since(
    own_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(own_folder.parent)
    run = api.open_run(api.begin(api.TrainRequest(own_folder.name, "smoke", out=tmp_path / "run")))
    monkeypatch.chdir("/")
    assert trained_robot(run.provenance).folder == own_folder
    failure = Failure(1, "a reason", "cpu", {}, run.provenance, run.config)
    (run.folder / FOLDER).mkdir()
    (run.folder / FOLDER / REPORT).write_text(dump(failure))
    edit(own_folder, "robot.yaml", "natural_frequency_hz: 14", "natural_frequency_hz: 13")
    for use in (api.resume, api.export_run, lambda folder: api.diagnose(folder, report=print)):
        assert "mine'" in refusal_of(use, run.folder)
    before_digests_were_kept = replace(run.provenance, robot_digest="")
    assert trained_robot(before_digests_were_kept).digest != run.provenance.robot_digest


def test_a_run_is_trained_by_one_process_at_a_time(whole_run: Path) -> None:
    with locked(api.open_run(whole_run)), pytest.raises(UserError, match=whole_run.name):
        api.resume(whole_run)


def test_a_folder_left_by_an_interrupted_start_can_be_used(whole_run: Path, tmp_path: Path) -> None:
    run = api.open_run(whole_run)
    for name in ("config.yaml", ".config.yaml.x1", ".run.yaml.x2"):
        (tmp_path / name).touch()
    create_run(tmp_path, run.provenance, run.config)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["config.yaml", "run.yaml"]
    (tmp_path / "run.yaml").unlink()
    (tmp_path / "notes.txt").touch()
    with pytest.raises(UserError):
        create_run(tmp_path, run.provenance, run.config)


def test_deployment_computes_the_same_as_training(whole_run: Path, go1: Robot) -> None:
    """The learned policy, given the environment's readings, has the same observations and targets."""
    trained = api.open_run(whole_run).config.env
    config = replace(trained, randomisation=Randomisation(), noise=Noise(), events=trained.events[:1])
    env, policy = LocomotionEnv(go1, config), LearnedPolicy(whole_run / "policy.onnx", go1)
    step, (state, seen) = jax.jit(env.step), jax.jit(env.reset)(jax.random.PRNGKey(0))
    state = state._replace(phase=jnp.zeros(1))  # a deployed policy starts its clock at zero
    for k in range(20):
        q, qd, w = (np.asarray(x, np.float64) for x in (state.qpos, state.qvel, state.qvel[3:6]))
        sensed = Sensed(w, np.zeros(3), q[3:7], q[7:], qd[6:], np.zeros(12))
        command = policy.act(PolicyInput(k * 0.02, sensed, np.asarray(state.command), np.zeros(3), 0.3))
        if k > 0:  # the reset's frame has another phase of the clock
            assert np.allclose(policy.observed, seen["state"], atol=1e-5)
        state, result = step(state, jnp.asarray(policy.action))
        seen = result.observation
        assert np.allclose(command.position, state.goals[0], atol=1e-5)


def git(folder: Path, *commands: str) -> None:
    for command in commands:
        author = ("-c", "user.name=a", "-c", "user.email=b")
        subprocess.run(["git", *author, *command.split()], cwd=folder, check=True)


def test_a_revision_differs_for_each_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "provenance.py"))
    source = tmp_path / "source.py"
    (tmp_path / "provenance.py").touch()
    seen = []
    for text in ("one", "two", "three", "one"):
        source.write_text(text)
        if not seen:
            git(tmp_path, "init -q", "add -A", "commit -q -m source")
        seen.append(provenance.source_revision())
    clean, two, three, again = seen
    assert re.fullmatch("[0-9a-f]{40}", clean)
    assert two.startswith(f"{clean} with uncommitted changes ")
    assert (len({clean, two, three}), again) == (3, clean)
    source.write_text("two")
    git(tmp_path, "add -A")  # staged is not committed
    assert provenance.source_revision() == two


@pytest.mark.parametrize("in_a_repository", [False, True])
def test_installed_files_identify_the_code_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_a_repository: bool
) -> None:
    """An installed wheel has only its files; its environment may be inside another repository."""
    installed = tmp_path / ".venv" / "footfall"
    source, data = installed / "train" / "api.py", installed / "policies" / "gaits.yaml"
    for file in (source, data):
        file.parent.mkdir(parents=True)
    monkeypatch.setattr(provenance, "__file__", str(installed / "train" / "runs" / "provenance.py"))
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    if in_a_repository:
        (tmp_path / ".gitignore").write_text(".venv")
        git(tmp_path, "init -q", "add -A", "commit -q -m theirs")
    seen = []
    for code, gaits in (("one", "trot"), ("two", "trot"), ("one", "pace"), ("one", "trot")):
        source.write_text(code)
        data.write_text(gaits)
        seen.append(provenance.source_revision())
    assert all(re.fullmatch("digest [0-9a-f]{8}", revision) for revision in seen)
    assert (len(set(seen)), seen[3]) == (3, seen[0])
