"""One HTML page, complete in itself, that holds a comparison: tables, films, plots, how it was measured."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from string import Template
from typing import Any

from evaluate import course_plots, scenario_plots
from evaluate.figures import Figure, Summary, best, figures, interval_text, measured, text
from evaluate.pool import Outcome
from evaluate.provenance import machine
from evaluate.scenarios import ScenarioFile
from evaluate.suite import Setup, Showing
from evaluate.svg import colour
from evaluate.table import warnings
from evaluate.video import Film
from robots.config import dump
from robots.description import Robot

TEMPLATE = Path(__file__).parent / "report.html"


@dataclass(frozen=True)
class Contender:
    """One policy of a comparison."""

    name: str
    kind: str  # how it came about, one sentence
    period_ms: float
    result: Mapping[str, Any]  # as it stands in the JSON
    showing: Showing
    film: Outcome[Film]


@dataclass(frozen=True)
class Comparison:
    """All that a report tells."""

    robot: Robot
    setup: Setup
    file: ScenarioFile
    contenders: Sequence[Contender]
    versions: Mapping[str, str]

    def summaries(self, scenario: str) -> dict[str, Summary]:
        """Figures of one scenario by contender."""
        return {c.name: c.result["scenarios"][scenario] for c in self.contenders}


def render(comparison: Comparison) -> str:
    """The page."""
    sections = [
        ("figures", "Figures", _headlines(comparison)),
        ("films", "Films", _films(comparison)),
        ("plots", "Plots", _plots(comparison)),
        ("scenarios", "All figures by scenario", _details(comparison)),
        ("method", "How it was measured", _method(comparison)),
    ]
    names = [contender.name for contender in comparison.contenders]
    setup = comparison.setup
    plant = f", plant {setup.plant.name}" if setup.plant else ""
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=html.escape(f"{' · '.join(names)} on {comparison.robot.name}"),
        subtitle=html.escape(
            f"{'Comparison' if len(names) > 1 else 'Evaluation'} in simulation over the robot's CAN frames"
            f"{plant}, seed {setup.seed}: {', '.join(setup.scenarios)}"
        ),
        contents="".join(
            f'<li><a href="#{key}">{title}</a></li>' for key, title, content in sections if content
        ),
        body="\n".join(
            f'<section id="{key}"><h2>{title}</h2>{content}</section>'
            for key, title, content in sections
            if content
        ),
        version=html.escape(comparison.versions["footfall"]),
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


# -- figures ---------------------------------------------------------------------------------------------


def _headlines(comparison: Comparison) -> str:
    """Contenders in rows; the first scenario's headline figures, the push, and the time per step."""
    columns: list[tuple[Figure, str]] = []
    known = figures()
    first = comparison.setup.scenarios[0]
    for key, figure in known.items():
        scenario = _pushing(comparison) if key == "dv50" else first
        if figure.headline and scenario and measured(figure, list(comparison.summaries(scenario).values())):
            columns.append((figure, scenario))
    head = "".join(
        f"<th scope=col>{html.escape(figure.label)}<small>{html.escape(figure.unit)} {html.escape(scenario)}</small></th>"
        for figure, scenario in columns
    )
    head += "<th scope=col>Time per step<small>ms p50 / p99, alone</small></th>"
    winners = {
        (figure.key, scenario): best(figure, list(comparison.summaries(scenario).values()))
        for figure, scenario in columns
    }
    rows = []
    for place, contender in enumerate(comparison.contenders):
        cells = "".join(
            _cell(figure, contender.result["scenarios"][scenario], place in winners[figure.key, scenario])
            for figure, scenario in columns
        )
        rows.append(
            f'<tr><th scope=row><span class=mark style="background:{colour(place)}"></span>'
            f"{html.escape(contender.name)}<small>{html.escape(contender.kind)}</small></th>"
            f"{cells}<td>{_compute_text(contender)}</td></tr>"
        )
    about = html.escape(comparison.file.scenarios[first].about)
    note = (
        f"<p class=soft>Small print: 95 % intervals. ★ marks the best. {html.escape(first)}: {about},"
        f" {max(s['episodes'] for s in comparison.summaries(first).values())} episodes.</p>"
    )
    table = f"<table><thead><tr><th scope=col>Contender</th>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    return f"<div class='card scroll'>{table}</div>{note}{_warnings(comparison)}"


def _pushing(comparison: Comparison) -> str | None:
    """The first scenario that looks for the push that half survive."""
    scenarios = comparison.setup.scenarios
    return next((name for name in scenarios if "push_m_s" in comparison.file.scenarios[name].levels), None)


def _cell(figure: Figure, summary: Summary, wins: bool) -> str:
    interval = interval_text(figure, summary)
    small = f"<small>{html.escape(interval)}</small>" if interval else ""
    kind = ' class="best"' if wins else ""
    return f"<td{kind}><b>{html.escape(text(figure, summary))}</b>{small}</td>"


def _compute_text(contender: Contender) -> str:
    times = contender.showing.compute["compute_ms"]
    if times["p50"] is None:
        return "–"
    return f"<b>{times['p50']:.2f} / {times['p99']:.2f}</b><small>of {contender.period_ms:g} ms</small>"


def _warnings(comparison: Comparison) -> str:
    lines = warnings({c.name: c.result for c in comparison.contenders})
    lines += [
        f"{c.name} did not walk the course: {c.showing.error}"
        for c in comparison.contenders
        if c.showing.error
    ]
    if not lines:
        return ""
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    return f'<div class="warn" role="note"><ul>{items}</ul></div>'


def _details(comparison: Comparison) -> str:
    parts = []
    for scenario in comparison.setup.scenarios:
        by_name = comparison.summaries(scenario)
        summaries = list(by_name.values())
        rows = []
        for figure in figures().values():
            if measured(figure, summaries):
                winners = best(figure, summaries)
                cells = "".join(_cell(figure, s, place in winners) for place, s in enumerate(summaries))
                rows.append(f"<tr><th scope=row>{html.escape(figure.title)}</th>{cells}</tr>")
        head = "".join(f"<th scope=col>{html.escape(name)}</th>" for name in by_name)
        parts.append(
            f"<details><summary>{html.escape(scenario)}</summary>"
            f"<p class=soft>{html.escape(comparison.file.scenarios[scenario].about)}.</p><div class=scroll>"
            f"<table class=figures><thead><tr><th></th>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
            f"</div>{_troubles(by_name)}</details>"
        )
    return f"<div class=card>{''.join(parts)}</div>"


def _troubles(summaries: Mapping[str, Summary]) -> str:
    """Why episodes ended early."""
    items = [
        f"<li>{html.escape(name)}: {html.escape(reason)} ({count})</li>"
        for name, summary in summaries.items()
        for reason, count in summary["troubles"].items()
    ]
    return (
        f"<p class=soft>What ended episodes early:</p><ul class=soft>{''.join(items)}</ul>" if items else ""
    )


# -- films and plots -------------------------------------------------------------------------------------


def _films(comparison: Comparison) -> str:
    figures_ = "".join(_film(contender) for contender in comparison.contenders)
    about = html.escape(comparison.file.scenarios["course"].about)
    return (
        f"<p class=soft>{about}. Blue arrow: commanded velocity. Green: true velocity. Red: push."
        " <button class=play type=button hidden>Play all together</button></p>"
        f"<div class=films>{figures_}</div>"
    )


def _film(contender: Contender) -> str:
    name, trace, film = html.escape(contender.name), contender.showing.trace, contender.film.value
    if film is None or trace is None:
        reason = contender.film.error or contender.showing.error
        return (
            f'<figure><div class="warn">No film of {name}: this machine could not render it'
            f" ({html.escape(reason)}).</div></figure>"
        )
    ending = f"fell after {trace.time_s[-1]:.1f} s" if trace.fell else "reached the end"
    return (
        f"<figure><video controls muted loop playsinline preload=metadata aria-label='{name} on the course'"
        f' poster="data:image/jpeg;base64,{film.poster_base64}"'
        f' src="data:video/mp4;base64,{film.mp4_base64}"></video>'
        f"<figcaption><b>{name}</b> {ending}</figcaption></figure>"
    )


def _plots(comparison: Comparison) -> str:
    file, chosen = comparison.file, comparison.setup.scenarios
    traces = {c.name: c.showing.trace for c in comparison.contenders if c.showing.trace is not None}
    periods = {c.name: c.period_ms for c in comparison.contenders}
    pushing = _pushing(comparison)
    one_level = [
        (file.scenarios[name].rows[0], comparison.summaries(name))
        for name in chosen
        if len(file.scenarios[name].rows) == 1 and name != pushing
    ]
    plots = (
        ("Tracking", course_plots.tracking(traces, comparison.contenders[0].showing.plan),
         f"True velocity over the course, averaged over {course_plots.SMOOTHED_S:g} s."),
        ("Pushes", scenario_plots.survival(comparison.summaries(pushing)) if pushing else None,
         "Survival against the size of the push. Marks: share of episodes with its 95 % Wilson interval. Lines:"
         " logistic fit. Large marks and bands: the push that half survive and its 95 % bootstrap interval."),
        ("Harder conditions", scenario_plots.conditions(one_level),
         "How tracking and falls change as one condition worsens, all else nominal."),
        ("Commands", scenario_plots.sweep(comparison.summaries("sweep")) if "sweep" in chosen else None,
         "Velocity error by command. Empty cells were not tried."),
        ("Torque and speed", course_plots.torque_speed(traces, comparison.robot),
         "Each mark is one joint at one of 100 samples per second on the course; lines: what a motor can deliver."),
        ("Timing", course_plots.timing(traces, periods),
         "Time per policy step on the course, one contender at a time, on one core of this machine."),
    )  # fmt: skip
    return "".join(
        f"<figure class=card><h3>{title}</h3>{svg}<figcaption>{html.escape(caption)}</figcaption></figure>"
        for title, svg, caption in plots
        if svg
    )


# -- method ----------------------------------------------------------------------------------------------


def _method(comparison: Comparison) -> str:
    setup, file = comparison.setup, comparison.file
    kinds = "".join(
        f"<li><b>{html.escape(c.name)}</b>: {html.escape(c.kind)}</li>" for c in comparison.contenders
    )
    estimate = (
        "Controllers that need the base's velocity were handed the true one (--ground-truth)."
        if setup.ground_truth
        else "Controllers that need the base's velocity estimate it from the same readings."
    )
    definitions = "".join(
        f"<div><dt>{html.escape(figure.title)}</dt><dd>{html.escape(figure.about)}</dd></div>"
        for figure in figures().values()
    )
    scenarios = "".join(
        f"<details><summary>{html.escape(name)}</summary><pre class=scroll>{html.escape(dump(file.scenarios[name]))}"
        "</pre></details>"
        for name in dict.fromkeys([*setup.scenarios, "course"])
    )
    versions = ", ".join(f"{name} {version}" for name, version in comparison.versions.items())
    return (
        "<div class=card><p>Every contender met the same episodes, drawn from the same seed, through the same"
        " control loop, joint limits, CAN frames and simulated motors. Figures are scored from the simulation's"
        f" true state. {estimate} Readings carry sensor noise.</p><ul>{kinds}</ul>"
        f"<p class=soft>Seed {setup.seed}. {html.escape(versions)}. {html.escape(machine())}.</p>"
        f"<h3>Definitions</h3><dl class=two>{definitions}</dl><h3>Scenarios</h3>{scenarios}</div>"
    )
