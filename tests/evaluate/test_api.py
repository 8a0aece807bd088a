"""Requests, refusals, names, origins and the command of an evaluation. No episode is run here."""

import io
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from outcomes import FILE
from rich.console import Console

from footfall.common.errors import UserError
from footfall.evaluate import api
from footfall.evaluate.comparison import Comparison, PolicyResult, command_line
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.provenance import origin
from footfall.evaluate.table import print_results
from footfall.policies.contract import Contract
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot


def test_impossible_requests_are_refused_before_the_first_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(api, "load_scenarios", lambda *_: FILE)
    monkeypatch.setattr(api, "run_suite", lambda *_: pytest.fail("an episode has begun"))
    rows: list[tuple[list[str], dict[str, Any], dict[str, Path], str]] = [
        ([], {}, {}, "policy"),
        (["stand"], {"episodes": 0}, {}, "episodes is 0"),
        (["stand"], {"scenarios": ("two", "ballet")}, {}, "'ballet'"),
        (["stand", "dance"], {}, {}, "'dance'"),
        (["dance"], {}, {}, "'dance'"),
        (["stand"], {"robot": "r2d2"}, {}, "'r2d2'"),
        (["stand"], {"plant": Path("absent.xml")}, {}, "absent.xml"),
        (["stand"], {}, {"json_path": Path("absent/out.json")}, "absent"),
        (["stand"], {}, {"html_path": Path("absent/out.html")}, "absent"),
        (["stand"], {}, {"html_path": Path("/dev/null")}, "/dev/null"),
        (["stand"], {}, {"json_path": Path("out"), "html_path": Path("out")}, "out"),
    ]
    for specs, settings, outputs, complaint in rows:
        config, quiet = replace(EvaluationConfig("go1", ("two",)), **settings), Console(quiet=True)
        with pytest.raises(UserError, match=complaint):
            api.compare_policies(specs, config, **outputs, console=quiet)
        if len(specs) == 1 and "html_path" not in outputs:
            with pytest.raises(UserError, match=complaint):
                api.evaluate_policy(*specs, config, **outputs, console=quiet)


def test_names_are_the_policies_own_where_they_differ() -> None:
    names = {"a": "x", "b": "y", "c": "x", "d": "caf\udce9"}
    policies: Any = {spec: SimpleNamespace(name=name) for spec, name in names.items()}
    assert api.policy_names(policies) == {"a": "a", "b": "y", "c": "c", "d": "caf?"}


def test_the_command_for_the_same_figures_is_shown() -> None:
    def command(config: EvaluationConfig, *specs: str) -> str:
        policies: Any = [PolicyResult(spec, spec, "", 2.0, {}, None) for spec in specs]  # type: ignore[arg-type]
        return command_line(Comparison(None, config, FILE, policies, {}))  # type: ignore[arg-type]

    plain = "footfall compare b a --robot go1 --scenarios one --seed 0 --html report.html"
    assert command(EvaluationConfig("go1", ("one",)), "b", "a") == plain
    config = EvaluationConfig("my robot", ("two", "one"), 7, 5, Path("a b.xml"), True, 3, Path("own.yaml"))
    assert command(config, "runs/it's mine") == (
        "footfall compare 'runs/it'\"'\"'s mine' --robot 'my robot' --scenarios two,one --seed 7"
        " --episodes 5 --scenario-file own.yaml --plant 'a b.xml' --ground-truth --html report.html"
    )


def test_brackets_in_a_name_are_not_markup() -> None:
    printed = io.StringIO()
    falls = {"falls": 4, "fall_rate": 4 / 24, "fall_rate_interval": [0.1, 0.2]}
    one = {"episodes": 24, "failed_episodes": [], "notes": [], **falls}
    print_results({"[bold]mine": {"scenarios": {"one": one}}}, Console(file=printed, width=200))
    assert printed.getvalue().count("[bold]mine") == 2  # over its column and in the verdict


def test_the_origin_names_the_trainer_and_a_motion_prior(contract: Contract) -> None:
    def learned(contract: Contract, **facts: str) -> Any:
        return SimpleNamespace(contract=contract, rate_hz=50.0, needs_estimate=False, **facts)

    assert contract.gait is not None
    assert any(contract.gait.amplitude_rad)
    assert "2.2 Hz (a motion prior)" in origin(learned(contract))
    without = replace(contract, gait=None)
    assert origin(learned(without)) == "learned policy, 50 Hz, no motion prior"
    by_trainer = "learned policy (trained by rsl_rl), 50 Hz, no motion prior"
    assert origin(learned(without, trainer="rsl_rl")) == by_trainer


def test_hand_written_controllers_declare_whether_they_need_an_estimate(go1: Robot) -> None:
    assert origin(load_policy("stand", go1)) == "hand-written controller, 500 Hz"
    assert "on estimated velocity" in origin(load_policy("mpc", go1))
