"""Metrics of the user, named MODULE:NAME, and requirements on figures."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from footfall import EvaluationConfig, Robot, UserError
from footfall.evaluate import api
from footfall.evaluate.requirements import outcomes_of, parse_requirements
from footfall.evaluate.scenarios import Scenario, ScenarioFile, load_scenarios

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


def test_means_of_the_users_metrics_are_reported(config: EvaluationConfig, go1: Robot) -> None:
    printed = io.StringIO()
    console = Console(file=printed, width=120)
    result = api.evaluate_policy("stand", config, json_path=Path("a.json"), console=console)
    still = result["scenarios"]["still"]
    mean = still["own"]["highest_base_m"]
    assert mean == pytest.approx(go1.description.standing_height_m, abs=0.05)
    low, high = still["own_interval"]["highest_base_m"]
    assert low <= mean <= high
    assert json.loads(Path("a.json").read_text()) == result
    assert f"{mean:.3f}" in printed.getvalue()


def test_unusable_metrics_are_refused(config: EvaluationConfig) -> None:
    for names, complaint in (
        (("absent_module:height",), "absent_module"), (("metrics_of_mine:absent",), "'absent'"),
        (("metrics_of_mine:nothing",), "metrics_of_mine:nothing"),
        (("metrics_of_mine:no_number",), "metrics_of_mine:no_number .*ValueError"),
        (("metrics_of_mine:highest_base_m",) * 2, "'highest_base_m'"),
    ):  # fmt: skip
        with pytest.raises(UserError, match=complaint):
            api.evaluate_policy("stand", replace(config, metrics=names), console=Console(quiet=True))


WALK = {"falls": 1, "lin_vel_rmse": 0.05, "own": {"lift": 0.2}}
RESULTS = {
    "a": {"scenarios": {"walk": WALK, "push": {"falls": 0}}},
    "b": {"scenarios": {"walk": {"falls": 0, "lin_vel_rmse": None}, "push": {}}},
}


def met(requirement: str) -> dict[tuple[str, str], bool]:
    """Whether each policy meets the requirement in each scenario."""
    parsed = parse_requirements([requirement], ["walk", "push"], ["mine:lift"])
    return {(each.policy, each.scenario): each.met for each in outcomes_of(parsed, RESULTS)}


def test_a_limit_holds_in_the_scenario_that_is_named_or_in_all() -> None:
    named, everywhere = met("walk.falls <= 0"), met("falls < 1")
    assert named == {("a", "walk"): False, ("b", "walk"): True}
    assert everywhere == named | {("a", "push"): True, ("b", "push"): False}  # b's falls were not measured
    assert met("walk.lin_vel_rmse <= 9") == {("a", "walk"): True, ("b", "walk"): False}  # nor b's error


def test_each_comparison_operator() -> None:
    for text, expected in (
        ("walk.lin_vel_rmse <= 0.05", True), ("walk.lin_vel_rmse < 0.05", False),
        ("walk.lin_vel_rmse >= 0.05", True), ("walk.lin_vel_rmse>0.05", False),
        ("walk.falls == 1", True), ("walk.own.lift >= 0.1", True), ("own.lift >= 0.3", False),
    ):  # fmt: skip
        assert met(text)["a", "walk"] is expected, text
