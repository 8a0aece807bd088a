"""Requests to the API: refusals, and names of policies. No episode is run here."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console
from scenario_file import FILE

from footfall.common.errors import UserError
from footfall.evaluate import api
from footfall.evaluate.config import EvaluationConfig

TWO = EvaluationConfig("go1", ("two",))


def begun(*_: Any) -> None:
    pytest.fail("an episode has begun")


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"specs": []}, "policy"),
        ({"episodes": 0}, "episodes is 0"),
        ({"scenarios": ("two", "ballet")}, "'ballet'"),
        ({"specs": ["stand", "dance"]}, "'dance'"),
        ({"specs": ["dance"]}, "'dance'"),
        ({"robot": "r2d2"}, "'r2d2'"),
        ({"plant": Path("absent.xml")}, "absent.xml"),
        ({"json_path": Path("absent/out.json")}, "absent"),
        ({"html_path": Path("absent/out.html")}, "absent"),
        ({"html_path": Path("/dev/null")}, "/dev/null"),
        ({"json_path": Path("out"), "html_path": Path("out")}, "out"),
    ],
)
def test_impossible_requests_are_refused_before_the_first_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any], complaint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(api, "load_scenarios", lambda *_: FILE)
    monkeypatch.setattr(api, "run_suite", begun)
    outputs = {key: changes[key] for key in ("json_path", "html_path") if key in changes}
    settings = {key: changes[key] for key in ("episodes", "scenarios", "robot", "plant") if key in changes}
    specs, config, quiet = changes.get("specs", ["stand"]), replace(TWO, **settings), Console(quiet=True)
    with pytest.raises(UserError, match=complaint):
        api.compare_policies(specs, config, **outputs, console=quiet)
    if len(specs) == 1 and "html_path" not in outputs:
        with pytest.raises(UserError, match=complaint):
            api.evaluate_policy(*specs, config, **outputs, console=quiet)


def test_names_are_the_policies_own_where_they_differ() -> None:
    names = {"a": "x", "b": "y", "c": "x", "d": "caf\udce9"}
    policies: Any = {spec: SimpleNamespace(name=name) for spec, name in names.items()}
    assert api.policy_names(policies) == {"a": "a", "b": "y", "c": "c", "d": "caf?"}
