"""A comparison, and its tables on the terminal."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from scenario_file import FILE, OWN, bare

from footfall.evaluate.comparison import Comparison, PolicyResult, command_line
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.scenarios import ScenarioFile
from footfall.evaluate.table import print_results


class TestComparison:
    """A report's statements about its origin."""

    def compared(
        self, config: EvaluationConfig, file: ScenarioFile = FILE, specs: Sequence[str] = ("b", "a")
    ) -> Any:
        policies = [
            PolicyResult(f"{spec}'s name", spec, "", 2.0, {"scenarios": {"one": spec}}, None)  # type: ignore[arg-type]
            for spec in specs
        ]
        return Comparison(None, config, file, policies, {})  # type: ignore[arg-type]

    def test_the_command_for_the_same_figures_is_shown(self) -> None:
        plain = "footfall compare b a --robot go1 --scenarios one --seed 0 --html report.html"
        assert command_line(self.compared(EvaluationConfig("go1", ("one",)))) == plain
        config = EvaluationConfig("my robot", ("two", "one"), 7, 5, Path("a b.xml"), True, 3, OWN)
        assert command_line(self.compared(config, specs=["runs/it's mine"])) == (
            "footfall compare 'runs/it'\"'\"'s mine' --robot 'my robot' --scenarios two,one --seed 7"
            " --episodes 5 --scenario-file own.yaml --plant 'a b.xml' --ground-truth --html report.html"
        )


def test_brackets_in_a_name_are_not_markup() -> None:
    console = Console(file=io.StringIO(), width=200)
    print_results({"[bold]mine": {"scenarios": {"one": bare("x")}}}, console)
    printed = console.file.getvalue()  # type: ignore[attr-defined]
    assert printed.count("[bold]mine") == 2  # over its column and in the verdict
