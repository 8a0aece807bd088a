"""Metrics of the user, named MODULE:NAME."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from footfall.common.errors import UserError
from footfall.evaluate import api
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.scenarios import Scenario, ScenarioFile, load_scenarios
from footfall.robots.description import Robot

SOURCE = '''
def highest_base_m(trace, robot):
    """Highest point of the base, m."""
    return trace.base_position[:, 2].max()

def no_number(trace, robot):
    return "much"

nothing = None
'''


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, go1: Robot) -> EvaluationConfig:
    """An evaluation in a folder with metrics of the user."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "metrics_of_mine.py").write_text(SOURCE)
    still = ScenarioFile(load_scenarios(go1).noise, {"still": Scenario("Standing", 2, 0.3)})
    monkeypatch.setattr(api, "load_scenarios", lambda *_: still)
    return EvaluationConfig("go1", ("still",), workers=1, metrics=("metrics_of_mine:highest_base_m",))


def test_means_of_the_users_metrics_are_reported(
    config: EvaluationConfig, tmp_path: Path, go1: Robot
) -> None:
    console = Console(file=io.StringIO(), width=120)
    result = api.evaluate_policy("stand", config, json_path=tmp_path / "a.json", console=console)
    still = result["scenarios"]["still"]
    mean = still["own"]["highest_base_m"]
    assert mean == pytest.approx(go1.description.standing_height_m, abs=0.05)
    low, high = still["own_interval"]["highest_base_m"]
    assert low <= mean <= high
    assert json.loads((tmp_path / "a.json").read_text()) == result
    assert f"{mean:.3f}" in console.file.getvalue()  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("names", "complaint"),
    [
        (("absent_module:height",), "absent_module"),
        (("metrics_of_mine:absent",), "'absent'"),
        (("metrics_of_mine:nothing",), "metrics_of_mine:nothing"),
        (("metrics_of_mine:no_number",), "metrics_of_mine:no_number .*ValueError"),
        (("metrics_of_mine:highest_base_m",) * 2, "'highest_base_m'"),
    ],
)
def test_unusable_metrics_are_refused(
    config: EvaluationConfig, names: tuple[str, ...], complaint: str
) -> None:
    with pytest.raises(UserError, match=complaint):
        api.evaluate_policy("stand", replace(config, metrics=names), console=Console(quiet=True))
