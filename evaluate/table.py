"""Results as tables on the terminal."""

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from footfall.evaluate.figures import Summary, best, figures, interval_text, measured, text


def print_results(results: Mapping[str, Mapping[str, Any]], console: Console) -> None:
    """One table per scenario, a column per contender, then whatever went wrong.

    Args:
        results: {policy: {"scenarios": {scenario: summary}, ...}}.
        console: where to.
    """
    contenders = list(results)
    for scenario in results[contenders[0]]["scenarios"]:
        summaries = [results[name]["scenarios"][scenario] for name in contenders]
        console.print(scenario_table(scenario, contenders, summaries))
    for line in warnings(results):
        console.print(Text(line, style="yellow"))


def scenario_table(scenario: str, contenders: list[str], summaries: list[Summary]) -> Table:
    """Figures in rows, contenders in columns, each with its 95 % interval; the best is marked."""
    table = Table(title=scenario, title_justify="left", title_style="bold")
    table.add_column("")
    for name in contenders:
        table.add_column(name, justify="right")
    for figure in figures().values():
        if not measured(figure, summaries):
            continue
        winners = best(figure, summaries)
        cells = []
        for index, summary in enumerate(summaries):
            cell = Text(text(figure, summary), style="bold green" if index in winners else "")
            interval = interval_text(figure, summary) if figure.headline else ""
            if interval:
                cell.append(f"\n{interval}", style="dim")
            cells.append(cell)
        table.add_row(figure.title, *cells)
    return table


def warnings(results: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """One line for each episode that could not be scored and each thing that the plant lacked."""
    lines = []
    for policy, result in results.items():
        for scenario, summary in result["scenarios"].items():
            lines += [f"{policy}, {scenario}: {error}" for error in summary["failed_episodes"]]
    notes = {
        note
        for result in results.values()
        for summary in result["scenarios"].values()
        for note in summary["notes"]
    }
    return lines + sorted(notes)
