"""Sweeps: mistakes are reported before anything runs; each trial is a run of its own and may fail alone."""

import csv
import json
import math
import os
import signal
import sys
import threading
import time
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from long_tests import long_test
from shell import Shell

from footfall.common.errors import UserError
from footfall.envs.config import RewardConfig
from footfall.train.config import load_preset
from footfall.train.runs.folder import open_run
from footfall.train.sweeps import sweep as sweep_module
from footfall.train.sweeps.config import SweepConfig
from footfall.train.sweeps.metric_names import reported_metrics
from footfall.train.sweeps.results import UNFINISHED, Trial, last_value, points_of
from footfall.train.sweeps.space import search_algorithm, search_space
from footfall.train.sweeps.sweep import collect_results, import_tune, sweep
from footfall.train.sweeps.trial import train_trial

pytestmark = [
    pytest.mark.usefixtures("kept_programs"),
    pytest.mark.skipif(find_spec("ray") is None, reason="needs Ray: install footfall[sweep]"),
]

METRIC = "tracking/linear_error_m_s"
GOOD_CLIP, BAD_CLIP = 0.1, 0.2


def written(folder: Path, **settings: object) -> Path:
    path = folder / "sweep.yaml"
    path.write_text(yaml.safe_dump({"preset": "smoke", "space": {}} | settings))
    return path


def test_a_mistake_is_named_in_advance(tmp_path: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_module, "reported_metrics", lambda *_: [METRIC])
    spaces = (
        ("learning_speed", {"uniform": [0, 1]}, "learning_speed"),
        ("layers.first", {"uniform": [0, 1]}, "ppo.layers.first"),
        ("clip_param", {"gaussian": [0, 1]}, "space.ppo.clip_param"),
        ("clip_param", {"uniform": [0, 1, 2, 3]}, "space.ppo.clip_param: uniform"),
        ("clip_param", {"uniform": ["a", "b"]}, "space.ppo.clip_param: uniform"),
        ("clip_param", {"grid_search": []}, "space.ppo.clip_param: grid_search"),
        ("num_steps_per_env", {"uniform": [1, 9]}, "num_steps_per_env"),
        ("num_steps_per_env", {"randint": [5, 5]}, "space.ppo.num_steps_per_env: randint"),
        ("num_steps_per_env", {"grid_search": [8, 0.5]}, "num_steps_per_env: 0.5"),
        ("gamma", {"uniform": [1.5, 1.7]}, "gamma must be from 0 to 1"),
    )
    no_such_time = {"name": "async_hyperband", "time_attr": "environment_step"}
    for key, value, named in (
        *(("space", {f"ppo.{name}": draw}, named) for name, draw, named in spaces),
        ("scheduler", {"name": "lottery"}, "scheduler"), ("scheduler", no_such_time, "environment_steps"),
        ("preset", "unheard-of", "unheard-of"), ("mode", "best", "mode"), ("seeds", [], "seeds"),
        ("trials", 0, "trials"), ("robot", "gp1", "gp1"),
        ("metric", "tracking/linear_eror_m_s", "tracking/linear_eror_m_s"),
    ):  # fmt: skip
        assert named in shell.refuses("sweep", written(tmp_path, **{key: value}), "--out", tmp_path / "out")
        assert not (tmp_path / "out").exists()


def test_a_trials_program_is_built_before_anything_runs(six_iterations: str) -> None:
    """A separate process builds it, returns the names of the metrics, and refuses an unknown reward."""
    config = load_preset(six_iterations)
    assert METRIC in (reported_metrics("go1", config, "brax") or [])
    env = replace(config.env, rewards=(RewardConfig("action_rte", weight=1.0),))
    with pytest.raises(UserError, match="action_rte"):
        reported_metrics("go1", replace(config, env=env), "brax")


def test_a_missing_file_is_named(tmp_path: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    assert str(tmp_path) in shell.refuses("sweep", "--resume", tmp_path)
    monkeypatch.setitem(sys.modules, "ray", None)
    assert "nosuch.yaml" in shell.refuses("sweep", tmp_path / "nosuch.yaml")
    assert "[sweep]'" in shell.refuses("sweep", written(tmp_path))


def drawn(config: SweepConfig) -> list[dict[str, object]]:
    """Settings of a sweep's trials, in the order in which Ray is given them."""
    tune = import_tune()
    tune.register_trainable("nothing", lambda settings: None)
    space = search_space(tune, config) | {"seed": tune.grid_search(list(config.seeds))}
    search = search_algorithm(config)
    search.add_configurations({"x": {"run": "nothing", "config": space, "num_samples": config.trials}})
    return [dict(search.next_trial().config) for _ in range(config.trainings)]


def test_draws_are_reproducible_and_the_same_for_each_seed() -> None:
    space = {"ppo.learning_rate": {"loguniform": [1e-4, 1e-2]}, "ppo.entropy_coef": {"uniform": [0.0, 0.01]}}
    config = SweepConfig(space, seeds=(3, 4), trials=5)
    settings = drawn(config)
    assert settings == drawn(config)
    rates = {seed: [s["ppo.learning_rate"] for s in settings if s["seed"] == seed] for seed in (3, 4)}
    assert rates[3] == rates[4]
    assert len(set(rates[3])) == 5
    grids = {"a": {"grid_search": [1, 2, 3]}, "b": {"uniform": [0, 1]}, "c": {"grid_search": [1, 2]}}
    assert SweepConfig(grids, seeds=(1, 2), trials=5).trainings == 60
    assert SweepConfig({}).trainings == 1


def test_a_trial_is_an_ordinary_run_that_reports_each_iteration(six_iterations: str, tmp_path: Path) -> None:
    """The setting is no part of the trial's program, which others have compiled."""
    config, folder = SweepConfig({}, preset=six_iterations), tmp_path / "trial"
    settings = {"diverged_limit": 0.5}
    reports: list[dict[str, float]] = []
    train_trial(config, folder, {"seed": 5} | settings, reports.append)
    run = open_run(folder)
    assert run.policy.is_file()
    assert run.config == replace(load_preset(six_iterations), **settings)
    assert (run.provenance.seed, run.provenance.trainer) == (5, "brax")
    assert [report["environment_steps"] for report in reports] == [256, 512, 768, 1024, 1280, 1536]
    assert all({METRIC, "episode/length_s", "speed/steps_per_s"} <= set(report) for report in reports)
    # When resumed, the trial finds its finished run.
    train_trial(config, folder, {"seed": 5} | settings, reports.append)
    assert len(reports) == 6


def quick_trials(tune: Any, config: SweepConfig, out: Path) -> Any:
    """Replaces trainings by very short trials. The first one waits until it is interrupted."""
    files = ("run.yaml", "policy.onnx", "metrics.jsonl", "begun")

    def trial(settings: dict[str, Any]) -> None:
        folder = out / tune.get_context().get_trial_id()
        folder.mkdir(exist_ok=True)
        run, policy, metrics, begun = (folder / name for name in files)
        if not (out / "interrupted").exists():
            begun.touch()
            time.sleep(60)
        if settings["ppo.clip_param"] == BAD_CLIP and settings["seed"] == 1:
            raise RuntimeError("it diverged")
        run.touch()
        # The last iteration is an outlier; the mean of the last ten is the seed plus 0.1.
        values = [settings["seed"] + 9.0] + [settings["seed"] + 1.0] * 9 + [settings["seed"] - 8.0]
        metrics.write_text("".join(json.dumps({METRIC: value}) + "\n" for value in values))
        tune.report({METRIC: values[-1], "environment_steps": 256})
        policy.touch()

    return tune.with_resources(trial, {"cpu": 0.1})


@pytest.mark.usefixtures("hangups_end_the_process")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_other_signals_end_a_sweep_as_ctrl_c_does(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    """Ray replaces the handler of SIGTERM by one that aborts the process."""

    def run_until_signal() -> None:
        with sweep_module._ray(SweepConfig({})):
            os.kill(os.getpid(), number)
            time.sleep(1.0)

    monkeypatch.setattr("ray.init", lambda **_: signal.signal(signal.SIGTERM, signal.SIG_DFL))
    monkeypatch.setattr("ray.shutdown", lambda: None)
    handlers = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    with pytest.raises(KeyboardInterrupt):
        run_until_signal()
    assert {each: signal.getsignal(each) for each in handlers} == handlers


@long_test
def test_an_interrupted_sweep_resumes(tmp_path: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sweep_module, "_trainable", quick_trials)
    monkeypatch.setattr(sweep_module, "reported_metrics", lambda *_: [METRIC])
    # Ray saves between a trial's last report and its end, as it may whenever the end takes a while.
    monkeypatch.setenv("TUNE_GLOBAL_CHECKPOINT_S", "0")
    file = written(tmp_path, seeds=[1, 2], space={"ppo.clip_param": {"grid_search": [GOOD_CLIP, BAD_CLIP]}})
    out = tmp_path / "out"

    def interrupt_once_begun() -> None:
        while not any(out.glob("*/begun")):
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt_once_begun, daemon=True).start()
    stopped = shell("sweep", file, "--out", out)
    assert (stopped.status, stopped.err.splitlines()[-1]) == (130, "footfall: interrupted")
    assert f"footfall sweep --resume {out}" in stopped.out
    assert {row["error"] for row in rows(out / "results.csv")} == {UNFINISHED}
    assert {row["failed"] for row in rows(out / "points.csv")} == {"0"}
    with pytest.raises(UserError):
        sweep(file, out)

    (out / "interrupted").touch()
    before = signal.getsignal(signal.SIGINT)
    resumed = shell("sweep", "--resume", out)
    assert signal.getsignal(signal.SIGINT) is before  # Ctrl-C interrupts again
    assert resumed.status == 1, resumed.err  # one trial failed
    assert "it diverged" in resumed.out
    results = rows(out / "results.csv")
    first, *equal = [(row["seed"], row["ppo.clip_param"]) for row in results[:3]]
    assert first == ("1", str(GOOD_CLIP))
    assert set(equal) == {("2", str(GOOD_CLIP)), ("2", str(BAD_CLIP))}
    assert float(results[0][METRIC]) == pytest.approx(1.1)
    good, bad = rows(out / "points.csv")
    counts = [[point[name] for name in ("ppo.clip_param", "seeds", "failed")] for point in (good, bad)]
    assert counts == [[str(GOOD_CLIP), "2", "0"], [str(BAD_CLIP), "1", "1"]]
    assert float(good[f"mean {METRIC}"]) == pytest.approx(1.6)
    assert float(good["standard deviation"]) == pytest.approx(0.5**0.5)
    assert bad["standard deviation"] == "nan"


def test_points_are_ranked_by_their_mean_not_by_their_best_seed() -> None:
    def trial(point: int, value: float) -> Trial:
        return Trial("folder", 0, {"ppo.clip_param": point}, value, 1, "")

    lucky, steady = [trial(1, 0.0), trial(1, 1.0)], [trial(2, 0.3), trial(2, 0.4)]
    first, second = points_of(lucky + steady, "min")
    assert (first.settings, first.mean) == ({"ppo.clip_param": 2}, pytest.approx(0.35))
    assert second.spread == pytest.approx(0.5**0.5)
    assert [point.settings["ppo.clip_param"] for point in points_of(lucky + steady, "max")] == [1, 2]


def test_a_runs_result_is_the_mean_of_its_last_iterations_with_a_value(tmp_path: Path) -> None:
    metrics = tmp_path / "metrics.jsonl"
    assert math.isnan(last_value(metrics, "a"))
    metrics.write_text('{"a": 9.0}\n{"a": 1.0}\n{"b": 5.0}\n{"a": 2.0}\n')
    assert last_value(metrics, "a", iterations=2) == 1.5
    with metrics.open("a") as file:
        file.write('{"step": 4, "a": 7')  # its process was killed
    assert last_value(metrics, "a", iterations=2) == 1.5
    assert math.isnan(last_value(metrics, "c"))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("mode", ["min", "max"])
def test_results_are_ranked_and_written_and_the_rest_is_counted(tmp_path: Path, mode: str) -> None:
    clips = {"ppo.clip_param": {"grid_search": [0.1, 0.2]}}
    config = SweepConfig(clips, seeds=(0, 1), trials=2, metric="m", mode=mode)
    grid = []
    for name, clip, seed, values, done, error in (
        ("t0", 0.1, 0, [5.0, 4.0], True, None), ("t1", 0.1, 1, [2.0], True, None),
        ("t2", 0.2, 0, [1.0], True, "a\nb"), ("t3", 0.2, 1, [3.5], False, None),
        ("t4", 0.2, 1, [], True, None), ("t5", 0.2, 0, [3.6], False, None),
    ):  # fmt: skip
        (tmp_path / name).mkdir()
        lines = "".join(json.dumps({"step": k, "m": value}) + "\n" for k, value in enumerate(values))
        (tmp_path / name / "metrics.jsonl").write_text(lines)
        trial = SimpleNamespace(path=f"/elsewhere/{name}", error=error)
        trial.config = {"ppo.clip_param": clip, "seed": seed}
        trial.metrics = {"done": done, "environment_steps": 10 * seed + 5}
        grid.append(trial)
    (tmp_path / "t5" / "policy.onnx").touch()
    found = collect_results(grid, config, tmp_path)
    good = ["t1", "t5", "t0"] if mode == "min" else ["t0", "t5", "t1"]
    assert [trial.folder for trial in found.trials[:4]] == [*good, "t4"]
    by_name = {trial.folder: trial for trial in found.trials}
    assert (by_name["t0"].value, by_name["t0"].steps, by_name["t1"].steps) == (4.5, 5, 15)
    errors = {name: trial.error for name, trial in by_name.items() if trial.error}
    assert (errors, found.unfinished) == ({"t2": "b", "t3": UNFINISHED}, 8 - 5)
    (first, *_), points = rows(tmp_path / "results.csv"), rows(tmp_path / "points.csv")
    assert first["folder"] == good[0]
    assert [point["ppo.clip_param"] for point in points] == ["0.1", "0.2"]
    columns = ("mean m", "standard deviation", "seeds", "failed", "unfinished")
    numbers = [float(points[0][name]) for name in columns]
    assert numbers == pytest.approx([3.25, np.std([4.5, 2.0], ddof=1), 2, 0, 0])
    assert [points[1][name] for name in ("mean m", "seeds", "failed", "unfinished")] == ["3.6", "1", "2", "1"]
