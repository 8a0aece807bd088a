"""Arguments that the API passes to the suite, and its output. No episode is run here."""

import io
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console
from scenario_file import FILE, OWN, bare

from footfall.common.errors import UserError
from footfall.evaluate import api
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.scenarios import ScenarioFile
from footfall.evaluate.suite import CourseWalk
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot

TWO = EvaluationConfig("go1", ("two",))


class TestApi:
    @pytest.fixture
    def ran(self, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """Arguments of the calls of suite and course."""
        seen = SimpleNamespace(order=[])

        def run_suite(
            policies: Any, config: EvaluationConfig, file: ScenarioFile, done: Any
        ) -> dict[str, Any]:
            seen.suite, seen.done = (policies, config, file), done
            seen.order.append("suite")
            return {spec: {name: bare(f"{spec} {name}") for name in config.scenarios} for spec in policies}

        def run_course(policies: Any, config: EvaluationConfig, file: ScenarioFile) -> dict[str, Any]:
            seen.course = (policies, config, file)
            seen.order.append("course")
            times = {spec: {"p50": 1.0 + number, "p99": 3.0} for number, spec in enumerate(policies)}
            return {
                spec: CourseWalk(
                    "plan", f"trace of {spec}", {"compute_ms": times[spec], "missed_deadlines": 0.5}, ""
                )  # type: ignore[arg-type]
                for spec in policies
            }

        def load_scenarios(robot: Robot, own: Path | None) -> ScenarioFile:
            assert robot.description.name == "go1"
            seen.own = own
            return FILE

        monkeypatch.setattr(api, "load_scenarios", load_scenarios)
        monkeypatch.setattr(api, "run_suite", run_suite)
        monkeypatch.setattr(api, "run_course", run_course)
        return seen

    @pytest.fixture
    def console(self) -> Console:
        return Console(file=io.StringIO(), width=200)

    def test_every_argument_of_evaluate_reaches_the_suite_and_the_json(
        self, ran: SimpleNamespace, go1: Robot, tmp_path: Path, console: Console
    ) -> None:
        path = tmp_path / "out.json"
        config = EvaluationConfig("go1", ("two", "one"), 7, 5, go1.xml_path, True, 3, OWN)
        result = api.evaluate_policy("trot", config, json_path=path, console=console)
        assert ran.suite == (["trot"], config, FILE)
        assert ran.order == ["suite"]
        assert ran.own == OWN
        assert json.loads(path.read_text()) == result
        assert list(result["scenarios"]) == ["two", "one"]
        assert result["scenarios"]["one"] == bare("trot one")
        shared = {key: result[key] for key in ("policy", "robot", "seed", "ground_truth", "plant")}
        assert shared == {
            "policy": "trot", "robot": "go1", "seed": 7, "ground_truth": True, "plant": str(go1.xml_path),
        }  # fmt: skip
        assert set(result["versions"]) >= {"footfall", "mujoco"}
        assert "cores" in result["machine"]
        printed = console.file.getvalue()  # type: ignore[attr-defined]
        assert printed.index("two") < printed.index("one") < printed.index("Over 24 episodes")

    def test_compare_gives_both_the_same_setup_and_joins_the_results(
        self, ran: SimpleNamespace, go1: Robot, tmp_path: Path, console: Console, monkeypatch: Any
    ) -> None:
        seen: list[Any] = []
        monkeypatch.setattr("footfall.evaluate.report.films.films_of", lambda of: seen.append(of) or "films")
        monkeypatch.setattr("footfall.evaluate.report.films.films_on_grounds", lambda of: "on grounds")
        monkeypatch.setattr("footfall.evaluate.report.page.render", lambda of, films, on: f"{films} {on}")
        json_path, html_path = tmp_path / "out.json", tmp_path / "out.html"
        config = EvaluationConfig("go1", ("two",), 7, 5, go1.xml_path, True, 3, OWN)
        specs = ["trot", "stand"]
        results = api.compare_policies(
            specs, config, json_path=json_path, html_path=html_path, console=console
        )
        assert ran.suite == ran.course == (specs, config, FILE)
        assert html_path.read_text() == "films on grounds"
        assert json.loads(json_path.read_text()) == results
        assert [(name, each["compute_ms"]["p50"]) for name, each in results.items()] == [
            ("trot", 1.0), ("stand", 2.0),
        ]  # fmt: skip
        (of,) = seen
        assert (of.robot.name, of.config, of.file) == ("go1", config, FILE)
        assert [each.course.trace for each in of.policies] == ["trace of trot", "trace of stand"]
        rates = [load_policy(name, go1).rate_hz for name in specs]
        assert [each.period_ms for each in of.policies] == [1e3 / rate for rate in rates]
        assert str(html_path) in console.file.getvalue()  # type: ignore[attr-defined]

    @pytest.mark.parametrize(
        ("changes", "complaint"),
        [
            ({"specs": []}, "name at least one policy"),
            ({"episodes": 0}, "episodes is 0: it must be 1 or more"),
            ({"scenarios": ("two", "ballet")}, "no scenario 'ballet'"),
            ({"specs": ["stand", "dance"]}, "no policy 'dance'"),
            ({"specs": ["dance"]}, "no policy 'dance'"),
            ({"robot": "r2d2"}, "no robot 'r2d2'"),
            ({"plant": Path("absent.xml")}, "no MJCF file at absent.xml"),
            ({"json_path": Path("absent/out.json")}, "absent"),
            ({"html_path": Path("absent/out.html")}, "absent"),
            ({"html_path": Path("/dev/null")}, "/dev/null"),
            ({"json_path": Path("out"), "html_path": Path("out")}, "its own name"),
        ],
    )
    def test_impossible_requests_are_refused_before_the_first_episode(
        self,
        ran: SimpleNamespace,
        console: Console,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        changes: dict[str, Any],
        complaint: str,
    ) -> None:
        monkeypatch.chdir(tmp_path)
        outputs = {"json_path", "html_path"}
        specs = changes.pop("specs", ["stand"])
        config = replace(TWO, **{key: value for key, value in changes.items() if key not in outputs})
        options: Any = {key: value for key, value in changes.items() if key in outputs} | {"console": console}
        with pytest.raises(UserError, match=complaint):
            api.compare_policies(specs, config, **options)
        if len(specs) == 1 and "html_path" not in changes:
            with pytest.raises(UserError, match=complaint):
                api.evaluate_policy(*specs, config, **options)
        assert ran.order == []

    def test_names_are_the_policies_own_where_they_differ(self) -> None:
        policies: Any = {
            spec: SimpleNamespace(name=name) for spec, name in zip("abc", ("x", "y", "x"), strict=True)
        }
        assert api.policy_names(policies) == {"a": "a", "b": "y", "c": "c"}
        odd: Any = {"spec": SimpleNamespace(name="caf\udce9")}
        assert api.policy_names(odd) == {"spec": "caf?"}
