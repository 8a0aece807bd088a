"""`footfall train`, `export` and what follows, with the smoke preset."""

import json
import os
import shutil
from contextlib import nullcontext
from functools import partial
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from recorder import Recorder
from shell import Shell

from footfall import EvaluationConfig, TrainRequest
from footfall.cli import main


@pytest.fixture(scope="module")
def run_folder(six_iterations: str, kept_programs: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of nearly the smoke preset, whose policy has walked two episodes of the usual ones."""
    folder = tmp_path_factory.mktemp("runs") / "smoke"
    with pytest.MonkeyPatch.context() as patch:
        import_module("footfall.verbs.train")  # the defaults of its options come from the replaced functions
        brief = partial(EvaluationConfig, episodes=2, workers=1)
        patch.setattr("footfall.evaluate.config.EvaluationConfig", brief)
        assert main(["train", "--preset", six_iterations, "--seed", "1", "--out", str(folder)]) == 0
    return folder


def test_training_evaluates_its_policy_and_export_writes_it_again(shell: Shell, run_folder: Path) -> None:
    assert (run_folder / "config.yaml").is_file()
    assert list((run_folder / "checkpoints").iterdir())
    assert json.loads((run_folder / "evaluation.json").read_text())["scenarios"]["gentle"]["episodes"] > 0
    assert f"--resume {run_folder}" in shell.refuses("train", "--preset", "smoke", "--out", run_folder)
    outcome = shell("export", run_folder, "--out", "again.onnx")
    assert outcome.status == 0, outcome.err
    assert Path("again.onnx").read_bytes() == (run_folder / "policy.onnx").read_bytes()


def test_a_damaged_checkpoint_is_named(shell: Shell, run_folder: Path, tmp_path: Path) -> None:
    copied = shutil.copytree(run_folder, tmp_path / "run")
    for path in (copied / "checkpoints").iterdir():
        path.write_bytes(b"garbage")
    (copied / "policy.onnx").unlink()  # otherwise nothing would be left to train
    for verb in (["train", "--resume"], ["export"]):
        outcome = shell(*verb, copied)
        assert (outcome.status, outcome.err.count("\n")) == (2, 1)
        assert str(copied) in outcome.err
        assert not (copied / "policy.onnx").exists()


class TestOptions:
    """The resulting requests, with a training that only records them."""

    @pytest.fixture
    def trained(self, called: Recorder, tmp_path: Path) -> Any:
        """A training in the run folder `made`, and the calls of its functions."""
        provenance = SimpleNamespace(robot="rex", seed=5)
        run = SimpleNamespace(policy=tmp_path / "policy.onnx", provenance=provenance)
        run.policy.touch()
        state = SimpleNamespace(run=run, main=True, called=called)

        for import_path, answer in (
            ("footfall.train.api.begin", Path("made")), ("footfall.train.api.resume", None),
            ("footfall.train.api.cluster.join", None),
            ("footfall.train.api.cluster.is_main_process", lambda: state.main),
            ("footfall.train.runs.folder.open_run", lambda _: run),
            ("footfall.verbs.train.start_device", None), ("footfall.verbs.train._check_evaluation", None),
            ("footfall.pages.page.check_page", None), ("footfall.pages.beside.watched", nullcontext()),
            ("footfall.evaluate.api.evaluate_policy", {"scenarios": {}}),
        ):  # fmt: skip
            called.replace(import_path, answer)
        return state

    def test_options_reach_the_request(self, shell: Shell, trained: Any) -> None:
        options = (
            "--robot", "rex", "--preset", "gpu", "--seed", "4", "--out", "there", "--steps", "1000",
            "--checkpoint-interval", "2.5", "--trainer", "rsl_rl", "--set", "ppo.learning_rate=1e-3",
            "--set", "env.gait={name: pace}",
        )  # fmt: skip
        settings = {"ppo.learning_rate": "1e-3", "env.gait": {"name": "pace"}}  # as YAML 1.1 reads them
        request = TrainRequest("rex", "gpu", 4, Path("there"), 1000, 2.5, "rsl_rl", settings)
        for given, expected in (((), TrainRequest()), (options, request)):
            trained.called.calls.clear()
            assert shell("train", *given).status == 0
            assert trained.called.of("begin") == ((expected,), {})

    def test_the_policy_is_evaluated_with_the_runs_robot_and_seed(self, shell: Shell, trained: Any) -> None:
        for tokens, folder in ((["train"], "made"), (["train", "--resume", "mine"], "mine")):
            trained.called.calls.clear()
            assert shell(*tokens).status == 0
            assert trained.called.of("resume") == ((Path(folder),), {})
            assert ("begin" in trained.called.names) == (folder == "made")
            options = {"json_path": Path(folder) / "evaluation.json"}
            given = (folder, EvaluationConfig("rex", ("gentle",), 5))
            assert trained.called.of("evaluate_policy") == (given, options)
        failed = {"scenarios": {"gentle": {"episodes": 1, "failed_episodes": ["episode 0: no"]}}}
        trained.called.replace("footfall.evaluate.api.evaluate_policy", failed)
        for tokens in (["train"], ["train", "--resume", "mine"]):
            assert shell(*tokens).status == 1

    def test_a_policy_newer_than_its_evaluation_walks_again(self, shell: Shell, trained: Any) -> None:
        evaluation = Path("made/evaluation.json")
        evaluation.parent.mkdir()
        evaluation.touch()
        os.utime(trained.run.policy, (1000, 1000))
        for older_s, walks in ((5, True), (0, False), (-5, False)):
            trained.called.calls.clear()
            os.utime(evaluation, (1000 - older_s, 1000 - older_s))
            assert shell("train").status == 0
            assert ("evaluate_policy" in trained.called.names) == walks
        assert shell("train", "--no-evaluate").status == 0
        trained.main = False
        assert shell("train").status == 0
        assert "evaluate_policy" not in trained.called.names

    def test_settings_of_a_resumed_run_are_refused(self, shell: Shell, trained: Any) -> None:
        """Settings equal to the defaults are refused, too."""
        settings = "out=x steps=9 checkpoint-interval=3 trainer=brax seed=0 preset=cpu robot=go1"
        for setting in settings.split():
            option, value = setting.split("=")
            assert f"--{option}" in shell.refuses("train", "--resume", "run", f"--{option}", value)
        assert trained.called.names == []

    def test_the_first_of_several_processes_serves_and_evaluates(self, shell: Shell, trained: Any) -> None:
        for cluster, joined, trained.main, pages in (
            ("h:1 --processes 2 --process 0", ("h:1", 2, 0), True, ["check_page", "watched"]),
            ("h:1 --processes 2 --process 1", ("h:1", 2, 1), False, []),
            ("auto", ("auto", None, None), True, ["watched"]),
        ):
            trained.called.calls.clear()
            outcome = shell("train", "--watch", "--coordinator", *cluster.split())
            assert outcome.status == 0, outcome.err
            assert trained.called.of("join") == (joined, {})
            assert trained.called.names.index("join") < trained.called.names.index("begin")
            assert "start_device" not in trained.called.names  # it would hold a device before joining
            assert [name for name in trained.called.names if name in ("check_page", "watched")] == pages
            assert ("evaluate_policy" in trained.called.names) is trained.main

    def test_an_invalid_cluster_is_refused(self, shell: Shell, trained: Any) -> None:
        for options, named in (
            *((f"--coordinator {host} --processes 2 --process 0", "HOST:PORT")
              for host in ("junk", "host:", "h:0", "host:65536")),
            ("--coordinator [::1]:12 --processes 2 --process 2", "the last of 2 is 1"),
            ("--processes 2 --process 1", "--coordinator"), ("--resume mine --process 0", "--coordinator"),
            ("--coordinator host:1 --processes 2", "--coordinator"),
            ("--coordinator h:1 --process 0", "--coordinator"),
            ("--coordinator auto --process 0 --processes 2", "--coordinator"),
        ):  # fmt: skip
            assert named in shell.refuses("train", *options.split())
        assert trained.called.names == []
