"""The films and plots of a report, as HTML."""

from collections.abc import Mapping
from html import escape

from footfall.evaluate.comparison import Comparison, PolicyResult
from footfall.evaluate.pool import Outcome
from footfall.evaluate.report import course_plots, scenario_plots
from footfall.evaluate.report.films import Film


def films(comparison: Comparison, films_by_name: Mapping[str, Outcome[Film]]) -> str:
    figures_ = "".join(_film(contender, films_by_name[contender.name]) for contender in comparison.policies)
    about = escape(comparison.file.scenarios["course"].about)
    return (
        f"<p class=soft>{about}. Blue arrow: commanded velocity. Green: true velocity. Red: push."
        " <button class=play type=button hidden>Play all together</button></p>"
        f"<div class=films>{figures_}</div>"
    )


def _film(contender: PolicyResult, outcome: Outcome[Film]) -> str:
    name, trace, film = escape(contender.name), contender.course.trace, outcome.value
    if film is None or trace is None:
        reason = outcome.error or contender.course.error
        return (
            f'<figure><div class="warn">No film of {name}: this machine could not render it'
            f" ({escape(reason)}).</div></figure>"
        )
    ending = f"fell after {trace.time_s[-1]:.1f} s" if trace.fell else "reached the end"
    return (
        f"<figure><video controls muted loop playsinline preload=metadata aria-label='{name} on the course'"
        f' poster="data:image/jpeg;base64,{film.poster_base64}"'
        f' src="data:video/mp4;base64,{film.mp4_base64}"></video>'
        f"<figcaption><b>{name}</b> {ending}</figcaption></figure>"
    )


def plots(comparison: Comparison) -> str:
    file, chosen = comparison.file, comparison.setup.scenarios
    traces = {c.name: c.course.trace for c in comparison.policies if c.course.trace is not None}
    periods = {c.name: c.period_ms for c in comparison.policies}
    pushing = comparison.push_scenario
    one_level = [
        (file.scenarios[name].rows[0], comparison.summaries(name))
        for name in chosen
        if len(file.scenarios[name].rows) == 1 and name != pushing
    ]
    plots = (
        ("Tracking", course_plots.tracking(traces, comparison.policies[0].course.plan),
         f"True velocity over the course, averaged over {course_plots.SMOOTHED_S:g} s."),
        ("Pushes", scenario_plots.survival(comparison.summaries(pushing)) if pushing else None,
         "Survival against the size of the push. Marks: share of episodes with its 95 % Wilson interval."
         " Lines: logistic fit. Large marks and bands: the push that half survive and its 95 %"
         " bootstrap interval."),
        ("Harder conditions", scenario_plots.conditions(one_level),
         "How tracking and falls change as one condition worsens, all else nominal."),
        ("Commands", scenario_plots.sweep(comparison.summaries("sweep")) if "sweep" in chosen else None,
         "Velocity error by command. Empty cells were not tried."),
        ("Torque and speed", course_plots.torque_speed(traces, comparison.robot),
         "Each mark is one joint at one of 100 samples per second on the course. Lines: what a motor can"
         " deliver."),
        ("Timing", course_plots.timing(traces, periods),
         "Time per policy step on the course, one contender at a time, on one core of this machine."),
    )  # fmt: skip
    return "".join(
        f"<figure class=card><h3>{title}</h3>{svg}<figcaption>{escape(caption)}</figcaption></figure>"
        for title, svg, caption in plots
        if svg
    )
