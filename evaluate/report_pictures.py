"""The films and plots of a report, as HTML."""

from html import escape

from footfall.evaluate import course_plots, scenario_plots
from footfall.evaluate.comparison import Comparison, Contender


def films(comparison: Comparison) -> str:
    figures_ = "".join(_film(contender) for contender in comparison.contenders)
    about = escape(comparison.file.scenarios["course"].about)
    return (
        f"<p class=soft>{about}. Blue arrow: commanded velocity. Green: true velocity. Red: push."
        " <button class=play type=button hidden>Play all together</button></p>"
        f"<div class=films>{figures_}</div>"
    )


def _film(contender: Contender) -> str:
    name, trace, film = escape(contender.name), contender.showing.trace, contender.film.value
    if film is None or trace is None:
        reason = contender.film.error or contender.showing.error
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
    traces = {c.name: c.showing.trace for c in comparison.contenders if c.showing.trace is not None}
    periods = {c.name: c.period_ms for c in comparison.contenders}
    pushing = comparison.push_scenario
    one_level = [
        (file.scenarios[name].rows[0], comparison.summaries(name))
        for name in chosen
        if len(file.scenarios[name].rows) == 1 and name != pushing
    ]
    plots = (
        ("Tracking", course_plots.tracking(traces, comparison.contenders[0].showing.plan),
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
