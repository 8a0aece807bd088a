"""Sweeps: a mistake is known before anything runs; each trial is an ordinary run; one that fails is one."""

import csv
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

pytest.importorskip("jax")
pytest.importorskip("ray")

from shell import Shell

from robots.config import dump
from robots.errors import UserError
from train.api import open_run
from train.config import load_preset
from train.sweep import resume_sweep, sweep, trial_config

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
    assert "pip install 'footfall[sweep]'" in shell.refuses("sweep", written(tmp_path))


def test_a_folder_without_a_sweep_cannot_be_resumed(tmp_path: Path, shell: Shell) -> None:
    assert "no sweep at" in shell.refuses("sweep", "--resume", tmp_path)


def test_trials_are_runs_and_one_that_fails_leaves_the_others(preset: str, tmp_path: Path) -> None:
    file = written(
        tmp_path,
        preset=preset,
        seeds=[5],
        space={"diverged_limit": {"grid_search": [0.5, -1.0]}},  # no training stays below the second
        cpus=0.5,
    )
    out = tmp_path / "out"
    good, bad = sweep(file, out)
    assert (good.error, good.settings, good.seed) == ("", {"diverged_limit": 0.5}, 5)
    assert good.steps == ITERATIONS * 256
    assert "diverged_limit -100.00%" in bad.error

    run = open_run(out / good.folder)
    assert run.policy.is_file()
    assert run.config == trial_config(preset, good.settings)
    assert (run.provenance.seed, run.provenance.trainer) == (5, "brax")
    with (out / "results.csv").open(newline="") as rows:
        table = list(csv.DictReader(rows))
    assert [row["folder"] for row in table] == [good.folder, bad.folder]
    assert float(table[0]["tracking/linear_error_m_s"]) == good.value

    with pytest.raises(UserError, match="is not empty"):
        sweep(file, out)
    assert [trial.folder for trial in resume_sweep(out)] == [good.folder, bad.folder]
