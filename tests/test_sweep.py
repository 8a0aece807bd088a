"""Sweeps: a mistake is known before anything runs; each trial is an ordinary run; one that fails is one."""

import csv
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

pytest.importorskip("jax")
pytest.importorskip("ray")

from shell import Shell

from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.train.api import open_run
from footfall.train.config import load_preset
from footfall.train.sweeps.sweep import UNFINISHED, resume_sweep, sweep, trial_config

ITERATIONS = 6


@pytest.fixture(scope="module")
def preset(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The program of test_train_runs, compiled once: nothing that is swept here is part of it."""
    smoke = load_preset("smoke")
    ppo = replace(smoke.ppo, total_steps=ITERATIONS * smoke.ppo.steps_per_iteration)
    path = tmp_path_factory.mktemp("presets") / "six.yaml"
    path.write_text(dump(replace(smoke, ppo=ppo)))
    return str(path)


def written(folder: Path, **settings: object) -> Path:
    path = folder / "sweep.yaml"
    path.write_text(yaml.safe_dump({"preset": "smoke", "space": {}} | settings))
    return path


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


def test_dotted_keys_replace_settings_and_nothing_else() -> None:
    smoke = load_preset("smoke")
    config = trial_config("smoke", {"ppo.learning_rate": 0.5, "env.rewards.torque": -1.0})
    assert config.ppo == replace(smoke.ppo, learning_rate=0.5)
    assert config.env.rewards == smoke.env.rewards | {"torque": -1.0}
    assert config.env.commands == smoke.env.commands


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"space": {"ppo.learning_speed": {"uniform": [0, 1]}}}, "no setting learning_speed"),
        ({"space": {"ppo.layers.first": {"uniform": [0, 1]}}}, "no setting ppo.layers.first"),
        (
            {"space": {"ppo.clip": {"gaussian": [0, 1]}}},
            "space.ppo.clip: expected one of choice, grid_search",
        ),
        ({"space": {"ppo.clip": {"uniform": [0, 1, 2, 3]}}}, "space.ppo.clip: uniform: "),
        ({"space": {"ppo.unroll": {"uniform": [1, 9]}}}, "unroll: "),
        ({"scheduler": {"name": "lottery"}}, "scheduler: "),
        ({"preset": "unheard-of"}, "no preset 'unheard-of'"),
        ({"mode": "best"}, "mode"),
        ({"seeds": []}, "seeds: the list is empty"),
        ({"trials": 0}, "trials must be at least 1"),
        ({"space": {"ppo.clip": {"grid_search": []}}}, "space.ppo.clip: grid_search: the list is empty"),
        ({"space": {"ppo.clip": {"choice": []}}}, "space.ppo.clip: choice: the list is empty"),
        ({"space": {"ppo.unroll": {"randint": [5, 5]}}}, "space.ppo.unroll: randint: "),
        ({"space": {"ppo.clip": {"uniform": ["a", "b"]}}}, "space.ppo.clip: uniform: "),
        ({"space": {"ppo.unroll": {"grid_search": [8, 0.5]}}}, "unroll: 0.5 is not a whole number"),
        ({"robot": "gp1"}, "gp1"),
        ({"space": {"env.rewards.action_rte": {"uniform": [-1, 0]}}}, "no reward 'action_rte'"),
        ({"metric": "tracking/linear_eror_m_s"}, "metric: a trial reports no 'tracking/linear_eror_m_s'"),
        (
            {"scheduler": {"name": "async_hyperband", "time_attr": "environment_step"}},
            "time_attr: a trial reports no 'environment_step': there are environment_steps, ",
        ),
    ],
    ids=lambda value: str(value)[:40],
)
def test_a_mistake_is_named_before_anything_runs(
    settings: dict[str, object], complaint: str, tmp_path: Path, shell: Shell
) -> None:
    out = tmp_path / "out"
    assert complaint in shell.refuses("sweep", written(tmp_path, **settings), "--out", out)
    assert not out.exists()


def test_without_ray_the_extra_is_named(
    tmp_path: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    assert "[sweep]'" in shell.refuses("sweep", written(tmp_path))


def test_a_folder_without_a_sweep_cannot_be_resumed(tmp_path: Path, shell: Shell) -> None:
    assert "no sweep at" in shell.refuses("sweep", "--resume", tmp_path)


@contextmanager
def interrupted_once(begun: Callable[[], bool]) -> Iterator[None]:
    """A Ctrl-C as soon as something has begun."""

    def watch() -> None:
        while not begun():
            if over.wait(0.05):
                return
        os.kill(os.getpid(), signal.SIGINT)

    over = threading.Event()
    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def test_an_interrupted_sweep_says_so_goes_on_and_one_trial_that_fails_leaves_the_others(
    preset: str, tmp_path: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Ray saves between a trial's last report and its end, as it may whenever the end takes a while.
    monkeypatch.setenv("TUNE_GLOBAL_CHECKPOINT_S", "0")
    file = written(
        tmp_path,
        preset=preset,
        seeds=[5],
        space={"diverged_limit": {"grid_search": [0.5, -1.0]}},  # no training stays below the second
        cpus=0.5,
    )
    out = tmp_path / "out"
    with interrupted_once(lambda: any(out.glob("*/run.yaml"))):  # its trial compiles then
        stopped = shell("sweep", file, "--out", out)
    assert (stopped.status, stopped.err.splitlines()[-1]) == (130, "footfall: interrupted")
    assert f"2 unfinished; continue with: footfall sweep --resume {out}" in stopped.out
    assert {row["error"] for row in rows(out)} == {UNFINISHED}

    (good, bad), unfinished = resume_sweep(out)
    assert unfinished == 0
    assert (good.error, good.settings, good.seed) == ("", {"diverged_limit": 0.5}, 5)
    assert good.steps == ITERATIONS * 256
    assert "diverged_limit -100.00%" in bad.error

    run = open_run(out / good.folder)
    assert run.policy.is_file()
    assert run.config == trial_config(preset, good.settings)
    assert (run.provenance.seed, run.provenance.trainer) == (5, "brax")
    table = rows(out)
    assert [row["folder"] for row in table] == [good.folder, bad.folder]
    assert float(table[0]["tracking/linear_error_m_s"]) == good.value

    with pytest.raises(UserError, match="is not empty"):
        sweep(file, out)
    again = resume_sweep(out)
    assert ([trial.folder for trial in again.trials], again.unfinished) == ([good.folder, bad.folder], 0)


def rows(out: Path) -> list[dict[str, str]]:
    with (out / "results.csv").open(newline="") as file:
        return list(csv.DictReader(file))
