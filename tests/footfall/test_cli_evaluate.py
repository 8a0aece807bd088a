"""`footfall evaluate` and `footfall compare`: content of the files, and exit status."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from recorder import Recorder
from shell import Shell

from footfall import EvaluationConfig, load_robot
from footfall.evaluate import api, suite
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.scenarios import Scenario, ScenarioFile, Waypoint, load_scenarios
from footfall.operate.missions.run import mission_run

FORWARD = Scenario("Straight ahead", 2, 1.4, script=(Waypoint(0.0, forward_m_s=0.5),))
SHORT = ScenarioFile(load_scenarios(load_robot("go1")).noise, {"forward": FORWARD})


@pytest.fixture(autouse=True)
def short_scenarios(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api, "load_scenarios", lambda *_: SHORT)


def test_evaluate_writes_the_documented_files(shell: Shell) -> None:
    brief = "--scenarios forward --episodes 1 --workers 1 --seed 4 --json trot.json"
    outcome = shell("evaluate", "trot", *brief.split())
    assert outcome.status == 0, outcome.err
    assert "forward" in outcome.out
    result = json.loads(Path("trot.json").read_text())
    assert (result["policy"], result["robot"], result["seed"]) == ("trot", "go1", 4)
    figures = result["scenarios"]["forward"]
    assert figures["episodes"] == 1
    assert {"falls", "lin_vel_rmse", "yaw_rate_rmse", "cost_of_transport"} <= set(figures)


def test_episodes_that_all_fail_end_in_one_line(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    died = TaskResult[Any](None, "its process died")
    monkeypatch.setattr(suite, "run_all", lambda _, tasks, *__: [died] * len(tasks))
    outcome = shell("evaluate", "stand", "--json", "a.json", "--scenarios", "forward")
    assert (outcome.status, outcome.err) == (1, "footfall: 2 of 2 episodes failed: its process died (2)\n")
    forward = json.loads(Path("a.json").read_text())["scenarios"]["forward"]
    assert forward["episodes"] == 0
    assert None not in forward.values()


def scored(*errors: str) -> dict[str, Any]:
    return {"scenarios": {"nominal": {"episodes": 4, "failed_episodes": list(errors)}}}


def test_options_reach_the_evaluation_and_the_comparison(shell: Shell, called: Recorder) -> None:
    called.replace("footfall.evaluate.api.evaluate_policy", scored())
    called.replace("footfall.evaluate.api.compare_policies", {"a": scored(), "b": scored()})
    all_options = (
        "--robot", "rex", "--scenarios", "push, nominal", "--episodes", "3", "--seed", "5", "--plant", "null",
        "--ground-truth", "--workers", "2", "--scenario-file", "own.yaml",
    )  # fmt: skip
    config = EvaluationConfig("rex", ("push", "nominal"), 5, 3, Path("null"), True, 2, Path("own.yaml"))
    for options, given in (((), EvaluationConfig()), (all_options, config)):
        expected = replace(given, mission_run=mission_run)
        called.calls.clear()
        assert shell("evaluate", "mine.onnx", *options).status == 0
        assert called.of("evaluate_policy") == (("mine.onnx", expected), {"json_path": None})
        assert shell("compare", "b", "a", *options, "--json", "none", "--html", "None").status == 0
        outputs = {"json_path": Path("none"), "html_path": Path("None")}
        assert called.of("compare_policies") == ((("b", "a"), expected), outputs)
    called.calls.clear()
    assert shell("evaluate", "stand", "--set", "stand.kd=2.5", "--set", "stand.kp=50").status == 0
    assert called.of("evaluate_policy")[0][0] == "stand@kd=2.5@kp=50"


def test_a_missed_requirement_is_status_1_in_xml(shell: Shell, called: Recorder) -> None:
    fallen = scored()
    fallen["scenarios"]["nominal"]["falls"] = 2
    called.replace("footfall.evaluate.api.evaluate_policy", fallen)
    for limits, unmet in (([2, 3], 0), ([1, 2], 1), ([0, 1], 2)):
        required = [part for limit in limits for part in ("--require", f"nominal.falls <= {limit}")]
        outcome = shell("evaluate", "a", *required, "--junit", "out.xml")
        assert (outcome.status, outcome.err.count("nominal.falls")) == (min(unmet, 1), unmet)
        suite = ElementTree.parse("out.xml").find("testsuite")
        assert suite is not None
        assert (suite.get("tests"), suite.get("failures")) == ("2", str(unmet))
        assert len(suite.findall("testcase/failure")) == unmet


def test_a_requirement_is_refused_before_anything_is_run(shell: Shell, called: Recorder) -> None:
    called.replace("footfall.evaluate.api.evaluate_policy", scored())
    for options, part in (
        (("--require", "falls"), "SCENARIO.FIGURE"), (("--require", "nominal.fals <= 0"), "falls"),
        (("--require", "climb.falls <= 0"), "'climb' is not run"),
        (("--require", "nominal.falls <= none"), "'none'"), (("--require", "nominal.falls <= inf"), "'inf'"),
        (("--require", "falls <= 0", "--junit", "no/such/folder/out.xml"), "no/such/folder"),
        (("--junit", "out.xml"), "--require"),
    ):  # fmt: skip
        assert part in shell.refuses("evaluate", "a", *options)
    assert "evaluate_policy" not in called.names
