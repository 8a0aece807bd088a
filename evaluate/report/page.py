"""One HTML page, complete in itself, that holds a comparison: tables, films, plots, how it was measured."""

from collections.abc import Mapping
from datetime import UTC, datetime
from html import escape
from pathlib import Path
from string import Template

from footfall.common.config import dump
from footfall.evaluate.comparison import Comparison
from footfall.evaluate.figures import figures
from footfall.evaluate.pool import Outcome
from footfall.evaluate.provenance import machine
from footfall.evaluate.report.films import Film
from footfall.evaluate.report.pictures import films, plots
from footfall.evaluate.report.tables import details, headlines

TEMPLATE = Path(__file__).parent / "page.html"


def render(comparison: Comparison, films_by_name: Mapping[str, Outcome[Film]]) -> str:
    """The page."""
    sections = [
        ("figures", "Figures", headlines(comparison)),
        ("films", "Films", films(comparison, films_by_name)),
        ("plots", "Plots", plots(comparison)),
        ("scenarios", "All figures by scenario", details(comparison)),
        ("method", "How it was measured", _method(comparison)),
    ]
    names = [contender.name for contender in comparison.policies]
    setup = comparison.setup
    plant = f", plant {setup.plant.name}" if setup.plant else ""
    return Template(TEMPLATE.read_text(encoding="utf-8")).substitute(
        title=escape(f"{' · '.join(names)} on {comparison.robot.name}"),
        subtitle=escape(
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
        version=escape(comparison.versions["footfall"]),
        date=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
    )


def _method(comparison: Comparison) -> str:
    setup, file = comparison.setup, comparison.file
    kinds = "".join(f"<li><b>{escape(c.name)}</b>: {escape(c.origin)}</li>" for c in comparison.policies)
    estimate = (
        "Controllers that need the base's velocity were handed the true one (--ground-truth)."
        if setup.ground_truth
        else "Controllers that need the base's velocity estimate it from the same readings."
    )
    definitions = "".join(
        f"<div><dt>{escape(figure.title)}</dt><dd>{escape(figure.about)}</dd></div>"
        for figure in figures().values()
    )
    scenarios = "".join(
        f"<details><summary>{escape(name)}</summary>"
        f"<pre class=scroll>{escape(dump(file.scenarios[name]))}</pre></details>"
        for name in dict.fromkeys([*setup.scenarios, "course"])
    )
    versions = ", ".join(f"{name} {version}" for name, version in comparison.versions.items())
    return (
        "<div class=card><p>Every contender met the same episodes, drawn from the same seed, through the same"
        " control loop, joint limits, CAN frames and simulated motors. Figures are scored from the"
        f" simulation's true state. {estimate} Readings carry sensor noise.</p><ul>{kinds}</ul>"
        f"<p class=soft>Seed {setup.seed}. {escape(versions)}. {escape(machine())}.</p>"
        f"<h3>Definitions</h3><dl class=two>{definitions}</dl><h3>Scenarios</h3>{scenarios}</div>"
    )
