"""A self-contained HTML page of a comparison: verdict, tables, films, plots, method."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from markupsafe import Markup

from footfall.common.config import dump
from footfall.evaluate.comparison import Comparison, command_line
from footfall.evaluate.figures import MIN_EPISODES, figures
from footfall.evaluate.own_metrics import definitions
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.provenance import machine
from footfall.evaluate.report import course_plots, scenario_plots, svg, tables
from footfall.evaluate.report.films import Film
from footfall.evaluate.report.learning_curves import learning_curves
from footfall.evaluate.report.sheet import rendered
from footfall.evaluate.report.short_names import short_names
from footfall.evaluate.suite import COURSE, CourseWalk
from footfall.evaluate.verdict import verdict

NO_FILMS: Mapping[str, Mapping[str, TaskResult[Film]]] = MappingProxyType({})
OPEN_PLOTS = 2  # number of plots that are open at first; the reader unfolds the others


@dataclass(frozen=True)
class ShownFilm:
    """A policy's film with its caption, or the reason why there is none."""

    policy: str
    film: Film | None
    text: str


@dataclass(frozen=True)
class FilmRow:
    """The films of all policies in one episode."""

    title: str  # empty for the course
    about: str
    films: list[ShownFilm]


def render(
    comparison: Comparison,
    films: Mapping[str, TaskResult[Film]],
    ground_films: Mapping[str, Mapping[str, TaskResult[Film]]] = NO_FILMS,
) -> str:
    """The page.

    Args:
        comparison: the results.
        films: films of each policy on the test course, by name.
        ground_films: films of each policy on the scenarios' grounds, by scenario and name.
    """
    full_names = [policy.name for policy in comparison.policies]
    names = short_names(full_names)
    comparison = replace(
        comparison, policies=[replace(policy, name=names[policy.name]) for policy in comparison.policies]
    )
    config, file = comparison.config, comparison.file
    return rendered(
        "page.html",
        columns,
        swatch,
        comparison=comparison,
        full_names=full_names,
        config=config,
        title=f"{' · '.join(names.values())} on {comparison.robot.name}",
        verdict=verdict({name: comparison.summaries(name) for name in config.scenarios}),
        headlines=tables.headline_table(comparison),
        falls=tables.falls_table(comparison),
        warnings=tables.all_warnings(comparison),
        films=_film_rows(comparison, full_names, films, ground_films),
        plots=[plot for plot in plots(comparison) if plot.panels],
        open_plots=OPEN_PLOTS,
        parts=tables.scenario_parts(comparison),
        definitions=[*figures().values(), *definitions(config.metrics)],
        scenarios={name: dump(file.scenarios[name]) for name in dict.fromkeys([*config.scenarios, COURSE])},
        settings={
            policy.name: dump(policy.result["settings"])
            for policy in comparison.policies
            if policy.result.get("settings")
        },
        min_episodes=MIN_EPISODES,
        command=command_line(comparison),
        machine=machine(),
        version=comparison.versions["footfall"],
    )


def plots(comparison: Comparison) -> list[svg.Plot]:
    """All plots in the order of the page; plots without data have no panels."""
    file, chosen, policies = comparison.file, comparison.config.scenarios, comparison.policies
    walks = [
        course_plots.Walk(index, policy.name, policy.course.trace, policy.period_ms)
        for index, policy in enumerate(policies)
        if policy.course.trace is not None and len(policy.course.trace.time_s)
    ]
    plan = policies[0].course.plan
    push_scenario = comparison.push_scenario
    one_level = [
        (file.scenarios[name].rows[0], comparison.summaries(name))
        for name in chosen
        if len(file.scenarios[name].rows) == 1 and name != push_scenario
    ]
    return [
        scenario_plots.survival(comparison.summaries(push_scenario) if push_scenario else {}),
        course_plots.tracking(walks, plan),
        course_plots.gait(walks, plan, comparison.robot),
        scenario_plots.conditions(one_level),
        scenario_plots.sweep(comparison.summaries("sweep") if "sweep" in chosen else {}),
        course_plots.torque_speed(walks, comparison.robot),
        course_plots.timing(walks),
        learning_curves({policy.name: policy.spec for policy in policies}),
    ]


def columns(pictures: int) -> int:
    """Number of pictures in a row, three at most; rows are full if possible."""
    return next((count for count in (3, 2) if pictures % count == 0), min(pictures, 3))


def swatch(index: int) -> Markup:
    """The line and marker of a policy, drawn so that it shows in print as well."""
    dashes = svg.DASHES[index % len(svg.DASHES)] or ()
    return Markup(
        '<svg class="swatch" viewBox="0 0 26 12" aria-hidden="true"><g stroke="{0}" fill="{0}">'
        '<path d="M0 6H26" stroke-width="2.4" stroke-dasharray="{1}"/><path d="{2}" stroke="none"/></g></svg>'
    ).format(
        svg.colour(index),
        " ".join(f"{1.6 * length:g}" for length in dashes),
        svg.MARKER_PATHS[svg.marker(index)],
    )


def _film_rows(
    comparison: Comparison,
    full_names: list[str],
    films: Mapping[str, TaskResult[Film]],
    ground_films: Mapping[str, Mapping[str, TaskResult[Film]]],
) -> list[FilmRow]:
    named_policies = list(zip(full_names, comparison.policies, strict=True))
    scenarios = comparison.file.scenarios
    course = [_shown_film(policy.name, policy.course, films[name]) for name, policy in named_policies]
    rows = [FilmRow("", scenarios[COURSE].about, course)]
    for scenario, by_name in ground_films.items():
        row_films = [
            _shown_film(policy.name, policy.on_grounds[scenario], by_name[name])
            for name, policy in named_policies
        ]
        levels = named_policies[0][1].on_grounds[scenario].plan.levels
        level = ", ".join(f"{name} {value:g}" for name, value in levels.items())
        rows.append(FilmRow(scenario, f"{scenarios[scenario].about} ({level})", row_films))
    return rows


def _shown_film(name: str, walk: CourseWalk, film: TaskResult[Film]) -> ShownFilm:
    trace = walk.trace
    if film.value is None or trace is None:
        return ShownFilm(name, None, walk.error or film.error)
    ending = f"fell after {trace.time_s[-1]:.1f} s" if trace.fell else "reached the end"
    return ShownFilm(name, film.value, ending)
