"""A comparison, and its tables on the terminal."""

import io
from pathlib import Path
from typing import Any

from rich.console import Console
from scenario_file import FILE, OWN, bare

from footfall.evaluate.comparison import Comparison, PolicyResult, command_line
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.table import print_results


def command_for(config: EvaluationConfig, *specs: str) -> str:
    result: Any = {"scenarios": {}}
    policies = [PolicyResult(spec, spec, "", 2.0, result, None) for spec in specs]  # type: ignore[arg-type]
    return command_line(Comparison(None, config, FILE, policies, {}))  # type: ignore[arg-type]


def test_the_command_for_the_same_figures_is_shown() -> None:
    plain = "footfall compare b a --robot go1 --scenarios one --seed 0 --html report.html"
    assert command_for(EvaluationConfig("go1", ("one",)), "b", "a") == plain
    config = EvaluationConfig("my robot", ("two", "one"), 7, 5, Path("a b.xml"), True, 3, OWN)
    assert command_for(config, "runs/it's mine") == (
        "footfall compare 'runs/it'\"'\"'s mine' --robot 'my robot' --scenarios two,one --seed 7"
        " --episodes 5 --scenario-file own.yaml --plant 'a b.xml' --ground-truth --html report.html"
    )


def test_brackets_in_a_name_are_not_markup() -> None:
    console = Console(file=io.StringIO(), width=200)
    print_results({"[bold]mine": {"scenarios": {"one": bare("x")}}}, console)
    printed = console.file.getvalue()  # type: ignore[attr-defined]
    assert printed.count("[bold]mine") == 2  # over its column and in the verdict
