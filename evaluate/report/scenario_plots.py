"""Plots of scenarios' figures: pushes, worsening conditions, a grid of commands."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from footfall.evaluate.figures import Summary, figures, interval_text, text
from footfall.evaluate.report.short_names import titled
from footfall.evaluate.report.svg import INK, PAPER, Panel, Plot, Reading, colour, line, marker
from footfall.evaluate.statistics import Survival

Summaries = Mapping[str, Summary]  # by policy

CONDITION_LABELS = {
    "friction": "friction coefficient",
    "payload_kg": "load, kg",
    "motor_strength": "motor strength, share",
    "action_delay_s": "added latency, s",
    "step_m": "step of the stairs, m",
    "angle_deg": "slope, degrees",
    "roughness_m": "heights above and below, m",
    "block_m": "highest block, m",
}

FEW_EPISODES = 4  # per size of push; a fit to fewer is a guess


def survival(summaries: Summaries) -> Plot:
    """Share of robots that stay up against the size of a push, a panel for each policy."""
    measured = [(index, *item) for index, item in enumerate(summaries.items()) if item[1].get("rows")]
    strongest = max((summary["strongest_push"] for _, _, summary in measured), default=1.0)
    return Plot(
        "Pushes",
        "Share of episodes that stayed up against the size of the push. Small marks: measured, with 95 %"
        " Wilson intervals. Line: logistic fit. Large mark and bar: median survivable push with its 95 %"
        f" bootstrap interval.{_warning(measured)}",
        [_survival_panel(index, policy, summary, strongest) for index, policy, summary in measured],
    )


def _warning(measured: list[tuple[int, str, Summary]]) -> str:
    """Warning if a fit is based on few episodes; otherwise empty."""
    fewest = min(
        (row["episodes"] for _, _, summary in measured for row in summary["rows"]), default=FEW_EPISODES
    )
    if fewest >= FEW_EPISODES:
        return ""
    return f" With {fewest} episode{'s' * (fewest != 1)} at a size, fit and interval are a guess."


def _survival_panel(index: int, policy: str, summary: Summary, strongest: float) -> Markup:
    median_push = figures()["dv50"]
    rows = summary["rows"]
    stood = np.array([1 - row["falls"] / row["episodes"] for row in rows])
    low, high = (1 - np.array([row["fall_rate_interval"] for row in rows]).T)[::-1]
    x = np.array([row["push_m_s"] for row in rows])
    with Panel(f"survival-{index}") as panel:
        ax = panel.axes
        ax.axhline(0.5, color=INK, lw=0.7, dashes=(1, 3))
        ax.errorbar(
            x, stood, [np.maximum(stood - low, 0), np.maximum(high - stood, 0)], fmt=marker(index),
            color=colour(index), ms=4.5, lw=0.8, alpha=0.7,
        )  # fmt: skip
        if summary["dv50"] is not None:
            grid = np.linspace(0.0, strongest, 120)
            fit = Survival(summary["dv50"], summary["dv50_width"], (0, 0))
            ax.plot(grid, fit.chance(grid), color=colour(index))
            # An edge beyond the strongest push tried is beyond the plot.
            edges = [1.05 * strongest if edge is None else edge for edge in summary["dv50_interval"]]
            ax.plot(edges, [0.5, 0.5], color=colour(index), lw=4, alpha=0.6, solid_capstyle="butt")
            ax.plot([summary["dv50"]], [0.5], marker(index), ms=10, mfc=PAPER, mec=colour(index), mew=2)
        ax.set(
            xlabel="push, m/s", ylabel="share that stayed up", xlim=(0, strongest * 1.04), ylim=(-0.04, 1.04)
        )
        ax.set_title(titled(policy, f"{text(median_push, summary)} m/s"))
        readings = [
            Reading(
                push_m_s,
                None,
                f"push of {push_m_s:g} m/s: {row['episodes'] - row['falls']} of {row['episodes']} stayed up"
                f"\n95 % interval {100 * below:.0f} to {100 * above:.0f} %"
                f"\nmedian survivable push {text(median_push, summary)} m/s"
                f" ({interval_text(median_push, summary) or '–'})",
            )
            for push_m_s, row, below, above in zip(x.tolist(), rows, low, high, strict=True)
        ]
        return panel.svg(f"Share of episodes that {policy} survived against the size of a push", readings)


def conditions(scenarios: Sequence[tuple[str, Summaries]]) -> Plot:
    """Velocity error, falls and, on uneven ground, successes over a condition: panels by scenario.

    Args:
        scenarios: keys of conditions, such as `friction`, each with {policy: summary} of its scenario.
    """
    panels = []
    for number, (condition, summaries) in enumerate(scenarios):
        rows = {policy: summary.get("rows", []) for policy, summary in summaries.items()}
        if any(rows.values()):
            panels += [
                _condition_panel(f"condition-{number}-{column}", condition, rows, figure)
                for column, figure in enumerate(_figures_of(rows))
            ]
    return Plot(
        "Harder conditions",
        "How tracking, falls and successes change as one condition worsens, all else as in the scenario."
        " Bars: 95 % Wilson intervals.",
        panels,
        legend=range(len(scenarios[0][1])) if panels else (),
    )


def _error(row: Summary) -> float:
    return math.nan if row["lin_vel_rmse"] is None else float(row["lin_vel_rmse"])


def _falls(row: Summary) -> float:
    return 100.0 * row["falls"] / row["episodes"]


def _successes(row: Summary) -> float:
    return 100.0 * float(row["success_rate"])


class ConditionFigure(NamedTuple):
    """A figure that a panel shows over a condition."""

    name: str
    unit: str
    measure: Callable[[Summary], float]  # of a row
    axis_top: float | None  # highest value of the axis; None: automatic
    interval: str = ""  # key of the row's interval, a share; empty without one


CONDITION_FIGURES = (
    ConditionFigure("velocity error", "m/s", _error, None),
    ConditionFigure("falls", "%", _falls, 105.0, "fall_rate_interval"),
)


SUCCESSES = ConditionFigure("successes", "%", _successes, 105.0, "success_rate_interval")


def _figures_of(rows: Mapping[str, list[Summary]]) -> tuple[ConditionFigure, ...]:
    """Figures that these rows have: successes are counted on uneven ground only."""
    is_uneven = any("success_rate" in row for each in rows.values() for row in each)
    return (*CONDITION_FIGURES, SUCCESSES) if is_uneven else CONDITION_FIGURES


def _condition_panel(
    identity: str, condition: str, rows: Mapping[str, list[Summary]], figure: ConditionFigure
) -> Markup:
    label = CONDITION_LABELS.get(condition, condition.replace("_", " "))
    with Panel(identity) as panel:
        ax = panel.axes
        lines: dict[float, list[str]] = {}
        for index, (policy, policy_rows) in enumerate(rows.items()):
            x, y = [row[condition] for row in policy_rows], [figure.measure(row) for row in policy_rows]
            ax.plot(x, y, **line(index), marker=marker(index), ms=4.5)
            for value, measured, row in zip(x, y, policy_rows, strict=True):
                interval = ""
                if figure.interval:
                    low, high = (100.0 * edge for edge in row[figure.interval])
                    ax.vlines(value, low, high, color=colour(index), lw=0.8, alpha=0.7)
                    interval = f" ({low:.0f} to {high:.0f})"
                lines.setdefault(value, []).append(f"{policy} {measured:.3g}{interval}")
        ax.set(xlabel=label, ylabel=figure.unit, title=figure.name)
        ax.set_ylim(bottom=0.0 if figure.axis_top is None else -5.0, top=figure.axis_top)
        readings = [
            Reading(value, None, "\n".join([f"{label} {value:g}: {figure.name}, {figure.unit}", *texts]))
            for value, texts in lines.items()
        ]
        return panel.svg(f"{figure.name} against {label}", readings)


def sweep(summaries: Summaries) -> Plot:
    """Velocity error and falls over a grid of commands; a panel for each policy."""
    tried = [(name, summary["rows"]) for name, summary in summaries.items() if summary.get("rows")]
    errors = np.array([_error(row) for _, rows in tried for row in rows])
    finite = errors[np.isfinite(errors)]
    large_error = float(np.percentile(finite, 95)) if len(finite) else 1.0
    return Plot(
        "Commands",
        "Velocity error in m/s by command, the darker the smaller. ✕: it fell. Empty cells were not tried.",
        [_sweep_panel(number, *item, large_error) for number, item in enumerate(tried)],
    )


def _sweep_panel(number: int, policy: str, rows: list[Summary], large_error: float) -> Markup:
    """Cells in colours from an error of 0 to `large_error`."""
    forward, yaw = (sorted({row[axis] for row in rows}) for axis in ("forward_m_s", "yaw_rad_s"))
    cells = np.full((len(yaw), len(forward)), np.nan)
    readings = []
    with Panel(f"sweep-{number}") as panel:
        ax = panel.axes
        for row in rows:
            y, x = yaw.index(row["yaw_rad_s"]), forward.index(row["forward_m_s"])
            error = _error(row)
            cells[y, x] = error
            mark = "✕" if row["falls"] else "" if math.isnan(error) else f"{error:.2f}"
            is_dark = not math.isnan(error) and error < 0.6 * large_error
            text_colour = INK if math.isnan(error) else "white" if is_dark else "black"
            ax.text(x, y, mark, ha="center", va="center", fontsize=10.5, color=text_colour)
            readings.append(
                Reading(
                    float(x),
                    float(y),
                    f"{row['forward_m_s']:g} m/s forward, {row['yaw_rad_s']:g} rad/s"
                    f"\nvelocity error {'–' if math.isnan(error) else f'{error:.3f} m/s'}"
                    f"\nfell in {row['falls']} of {row['episodes']}",
                )
            )
        ax.imshow(cells, origin="lower", aspect="auto", cmap="viridis", vmin=0.0, vmax=large_error)
        ax.set_xticks(range(len(forward)), [f"{value:g}" for value in forward])
        ax.set_yticks(range(len(yaw)), [f"{value:g}" for value in yaw])
        ax.set(title=policy, xlabel="forward, m/s", ylabel="yaw rate, rad/s")
        ax.grid(visible=False)
        return panel.svg(f"Velocity error of {policy} over commanded forward speed and yaw rate", readings)
