"""Results as tables on the terminal."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from footfall.evaluate.failures import failures
from footfall.evaluate.figures import Summary, best, figures, interval_text, measured, text
from footfall.evaluate.own_metrics import own_figures
from footfall.evaluate.verdict import verdict

_FIGURE = re.compile(r"\d+(\.\d+)?")


def print_results(results: Mapping[str, Mapping[str, Any]], console: Console) -> None:
    """Print one table per scenario, a column per policy, then the verdict and warnings.

    Args:
        results: {policy: {"scenarios": {scenario: summary}, ...}}.
        console: the terminal.
    """
    names = list(results)
    by_scenario = {
        scenario: {name: results[name]["scenarios"][scenario] for name in names}
        for scenario in results[names[0]]["scenarios"]
    }
    for scenario, summaries in by_scenario.items():
        console.print(scenario_table(scenario, names, list(summaries.values())))
    console.print(Text(verdict(by_scenario)))
    for line in warnings(results):
        console.print(Text(line, style="yellow"))


def scenario_table(scenario: str, names: list[str], summaries: list[Summary]) -> Table:
    """Figures in rows, policies in columns, each with its 95 % interval; a clear winner is green."""
    table = Table(title=scenario, title_justify="left", title_style="bold")
    table.add_column("")
    for name in names:
        table.add_column(Text(name), justify="right")
    for figure in [*figures().values(), *own_figures(summaries)]:
        if not measured(figure, summaries):
            continue
        winner = best(figure, summaries)
        cells = []
        for index, summary in enumerate(summaries):
            cell = Text(text(figure, summary), style="bold green" if index == winner else "")
            interval = interval_text(figure, summary) if figure.is_headline else ""
            if interval:
                cell.append(f"\n{interval}", style="dim")
            cells.append(cell)
        table.add_row(figure.title, *cells)
    return table


def weakest_table(policy: str, disturbances: Mapping[str, Any]) -> Table:
    """Disturbances that make a policy fall, one a row (`footfall.evaluate.weakest.weakest`)."""
    table = Table(
        title=f"smallest disturbances that make {policy} fall", title_justify="left", title_style="bold"
    )
    for heading in ("", "smallest", "median", "95 % interval", "walked on"):
        table.add_column(heading, justify="right" if heading else "left")
    for name, each in disturbances.items():
        if name == "together":
            parts = ", ".join(f"{part} {value:.3g}" for part, value in each["values"].items())
            table.add_row(f"together, {each['size']:.2f} of each alone", parts)
            continue
        low, high = (_size_text(end) for end in each["interval"])
        title = f"{name}, {each['unit']}" if each["unit"] else name
        walked_on = f"{each['never_fell']} of {each['episodes']}"
        table.add_row(
            title, _size_text(each["smallest"]), _size_text(each["median"]), f"{low} to {high}", walked_on
        )
    return table


def _size_text(value: float | None) -> str:
    return "nothing" if value is None else f"{value:.3g}"


def warnings(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """One line for each scenario with failed episodes, and one for each note of an episode."""
    lines = []
    notes: set[str] = set()
    for policy, result in results.items():
        for scenario, summary in result["scenarios"].items():
            if summary["failed_episodes"]:
                lines.append(f"{policy}, {scenario}: {failures([summary])}")
            notes |= set(summary.get("notes", ()))
    return lines + _merged_notes(notes)


def _merged_notes(notes: Iterable[str]) -> list[str]:
    """Notes that differ only in their numbers, merged into one line."""
    by_text: dict[str, list[str]] = {}
    for note in sorted(notes):
        by_text.setdefault(_FIGURE.sub("", note), []).append(note)
    return [first + (f", and {len(more)} more" if more else "") for first, *more in by_text.values()]
