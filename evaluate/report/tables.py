"""The tables of a report, as HTML."""

from collections.abc import Mapping, Sequence
from html import escape

from footfall.evaluate.comparison import Comparison, PolicyResult
from footfall.evaluate.figures import Figure, Summary, best, figures, interval_text, measured, text
from footfall.evaluate.report.svg import colour
from footfall.evaluate.table import warnings


def headlines(comparison: Comparison) -> str:
    """Contenders in rows; the first scenario's headline figures, the push, and the time per step."""
    columns: list[tuple[Figure, str]] = []
    known = figures()
    first = comparison.setup.scenarios[0]
    for key, figure in known.items():
        scenario = comparison.push_scenario if key == "dv50" else first
        if figure.headline and scenario and measured(figure, list(comparison.summaries(scenario).values())):
            columns.append((figure, scenario))
    head = "".join(_heading(figure, scenario) for figure, scenario in columns)
    head += "<th scope=col>Time per step<small>ms p50 / p99, alone</small></th>"
    winners = {
        (figure.key, scenario): best(figure, list(comparison.summaries(scenario).values()))
        for figure, scenario in columns
    }
    rows = []
    for place, contender in enumerate(comparison.policies):
        cells = "".join(
            _cell(figure, contender.result["scenarios"][scenario], place == winners[figure.key, scenario])
            for figure, scenario in columns
        )
        rows.append(
            f'<tr><th scope=row><span class=mark style="background:{colour(place)}"></span>'
            f"{escape(contender.name)}<small>{escape(contender.origin)}</small></th>"
            f"{cells}<td>{_compute_text(contender)}</td></tr>"
        )
    about = escape(comparison.file.scenarios[first].about)
    note = (
        "<p class=soft>Small figures are 95 % intervals. ★ marks the best, in tracking and effort among"
        f" those that fell least. Scenario '{escape(first)}': {about},"
        f" {max(s['episodes'] for s in comparison.summaries(first).values())} episodes.</p>"
    )
    table = _table("PolicyResult", head, rows)
    return f"<div class='card scroll'>{table}</div>{note}{_warnings(comparison)}"


def _table(corner: str, head: str, rows: Sequence[str], kind: str = "") -> str:
    first = f"<th scope=col>{corner}</th>" if corner else "<td></td>"
    body = "".join(rows)
    return f'<table class="{kind}"><thead><tr>{first}{head}</tr></thead><tbody>{body}</tbody></table>'


def _cell(figure: Figure, summary: Summary, wins: bool) -> str:
    interval = interval_text(figure, summary)
    small = f"<small>{escape(interval)}</small>" if interval else ""
    kind = ' class="best"' if wins else ""
    return f"<td{kind}><b>{escape(text(figure, summary))}</b>{small}</td>"


def _heading(figure: Figure, scenario: str) -> str:
    where = f"{figure.unit}, {scenario}" if figure.unit else scenario
    return f"<th scope=col>{escape(figure.label)}<small>{escape(where)}</small></th>"


def _compute_text(contender: PolicyResult) -> str:
    times = contender.course.compute["compute_ms"]
    if times["p50"] is None:
        return "–"
    return f"<b>{times['p50']:.2f} / {times['p99']:.2f}</b><small>of {contender.period_ms:g} ms</small>"


def _warnings(comparison: Comparison) -> str:
    lines = warnings({c.name: c.result for c in comparison.policies})
    lines += [
        f"{c.name} did not walk the course: {c.course.error}" for c in comparison.policies if c.course.error
    ]
    if not lines:
        return ""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    return f'<div class="warn" role="note"><ul>{items}</ul></div>'


def details(comparison: Comparison) -> str:
    parts = []
    for scenario in comparison.setup.scenarios:
        by_name = comparison.summaries(scenario)
        summaries = list(by_name.values())
        rows = []
        for figure in figures().values():
            if measured(figure, summaries):
                winner = best(figure, summaries)
                cells = "".join(_cell(figure, s, place == winner) for place, s in enumerate(summaries))
                rows.append(f"<tr><th scope=row>{escape(figure.title)}</th>{cells}</tr>")
        head = "".join(f"<th scope=col>{escape(name)}</th>" for name in by_name)
        parts.append(
            f"<details><summary>{escape(scenario)}</summary>"
            f"<p class=soft>{escape(comparison.file.scenarios[scenario].about)}.</p><div class=scroll>"
            f"{_table('', head, rows, 'figures')}</div>{_troubles(by_name)}</details>"
        )
    return f"<div class=card>{''.join(parts)}</div>"


def _troubles(summaries: Mapping[str, Summary]) -> str:
    """Why episodes ended early."""
    items = [
        f"<li>{escape(name)}: {escape(reason)} ({count})</li>"
        for name, summary in summaries.items()
        for reason, count in summary.get("troubles", {}).items()
    ]
    return (
        f"<p class=soft>What ended episodes early:</p><ul class=soft>{''.join(items)}</ul>" if items else ""
    )
