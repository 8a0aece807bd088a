"""The tables of a report as plain data; the page's template draws them."""

from collections.abc import Sequence
from dataclasses import dataclass

from footfall.evaluate.comparison import Comparison, PolicyResult
from footfall.evaluate.figures import Figure, Summary, best, figures, interval_text, measured, text
from footfall.evaluate.own_metrics import own_figures
from footfall.evaluate.table import warnings
from footfall.evaluate.verdict import headlines


@dataclass(frozen=True)
class Cell:
    """A number, with smaller text below it."""

    text: str
    small: str = ""
    is_best: bool = False


@dataclass(frozen=True)
class Heading:
    """Heading of a column or a row."""

    label: str
    small: str = ""
    index: int | None = None  # index of the policy, which sets its colour


@dataclass(frozen=True)
class Table:
    """Rows of cells; a heading for each row and each column."""

    corner: str
    columns: Sequence[Heading]
    rows: Sequence[tuple[Heading, Sequence[Cell]]]


@dataclass(frozen=True)
class ScenarioPart:
    """All figures of one scenario, and the reasons why episodes ended early."""

    name: str
    about: str
    table: Table
    endings: Sequence[str]


def headline_table(comparison: Comparison) -> Table:
    """Policies in rows; the headline figures, and the time per step."""
    by_scenario = {name: comparison.summaries(name) for name in comparison.config.scenarios}
    chosen = headlines(by_scenario)
    columns = [_cells(figure, list(by_scenario[scenario].values())) for figure, scenario in chosen]
    columns.append([_time_per_step(policy) for policy in comparison.policies])
    headings = [
        Heading(figure.label, ", ".join(filter(None, [figure.unit, scenario]))) for figure, scenario in chosen
    ]
    headings.append(Heading("Time per step", "ms p50 / p99, alone"))
    rows = [
        (Heading(policy.name, policy.origin, index), [column[index] for column in columns])
        for index, policy in enumerate(comparison.policies)
    ]
    return Table("Policy", headings, rows)


def falls_table(comparison: Comparison) -> Table:
    """Policies in rows, scenarios in columns: number of falls."""
    falls = figures()["falls"]
    scenarios = comparison.config.scenarios
    columns = [_cells(falls, list(comparison.summaries(name).values())) for name in scenarios]
    rows = [
        (Heading(policy.name, index=index), [column[index] for column in columns])
        for index, policy in enumerate(comparison.policies)
    ]
    return Table("Policy", [Heading(name) for name in scenarios], rows)


def scenario_parts(comparison: Comparison) -> list[ScenarioPart]:
    """A table for each scenario: figures in rows, policies in columns."""
    columns = [Heading(policy.name, index=index) for index, policy in enumerate(comparison.policies)]
    parts = []
    for scenario in comparison.config.scenarios:
        by_name = comparison.summaries(scenario)
        summaries = list(by_name.values())
        rows = [
            (Heading(figure.label, figure.unit), _cells(figure, summaries))
            for figure in [*figures().values(), *own_figures(summaries)]
            if measured(figure, summaries)
        ]
        endings = [
            f"{name}: {reason} ({count})"
            for name, summary in by_name.items()
            for reason, count in summary.get("troubles", {}).items()
        ]
        about = comparison.file.scenarios[scenario].about
        parts.append(ScenarioPart(scenario, about, Table("Figure", columns, rows), endings))
    return parts


def all_warnings(comparison: Comparison) -> list[str]:
    """Warnings that limit how far the figures can be trusted."""
    lines = warnings({policy.name: policy.result for policy in comparison.policies})
    return lines + [
        f"{policy.name} did not walk the course: {policy.course.error}"
        for policy in comparison.policies
        if policy.course.error
    ]


def _cells(figure: Figure, summaries: Sequence[Summary]) -> list[Cell]:
    """Cells with one figure, for each policy."""
    winner = best(figure, summaries)
    return [
        Cell(text(figure, summary), interval_text(figure, summary), index == winner)
        for index, summary in enumerate(summaries)
    ]


def _time_per_step(policy: PolicyResult) -> Cell:
    times = policy.course.compute["compute_ms"]
    if times["p50"] is None:
        return Cell("–")
    return Cell(f"{times['p50']:.2f} / {times['p99']:.2f}", f"of {policy.period_ms:g} ms")
