"""Plots of scenarios' figures. Each is an SVG, or None where there is nothing to show."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from footfall.evaluate.figures import Summary
from footfall.evaluate.report.svg import (
    INK,
    PAPER,
    WIDTH_IN,
    axes_grid,
    colour,
    drawing,
    legend_above,
    line,
    marker,
    to_svg,
)
from footfall.evaluate.statistics import Survival

LEVEL_LABELS = {
    "friction": "friction coefficient",
    "payload_kg": "load, kg",
    "motor_strength": "motor strength, share",
    "action_delay_s": "added latency, s",
}


def survival(summaries: Mapping[str, Summary]) -> str | None:
    """Share of robots that stay up against the size of a push, with the 50 % point and its interval."""
    shown = {
        name: summary for name, summary in summaries.items() if summary.get("rows") and "dv50" in summary
    }
    if not shown:
        return None
    with drawing("survival"):
        figure, (ax,) = axes_grid(1, 1, (WIDTH_IN, 3.8))
        strongest = max(summary["strongest_push"] for summary in shown.values())
        for place, (policy, summary) in enumerate(shown.items()):
            _survival_of(ax, place, policy, summary, strongest)
        ax.axhline(0.5, color=INK, lw=0.7, dashes=(1, 3))
        ax.set(
            xlabel="push Δv, m/s",
            ylabel="share that stays up",
            xlim=(0, strongest * 1.04),
            ylim=(-0.04, 1.04),
        )
        legend_above(figure, ax, 6)
        return to_svg(figure, "Share of episodes survived against the size of a push, for each contender")


def _survival_of(ax: Axes, place: int, policy: str, summary: Summary, strongest: float) -> None:
    rows = summary["rows"]
    x = np.array([row["push_m_s"] for row in rows]) + 0.012 * strongest * (place - 1)  # side by side
    stood = np.array([1 - row["falls"] / row["episodes"] for row in rows])
    low, high = (1 - np.array([row["fall_rate_interval"] for row in rows]).T)[::-1]
    ax.errorbar(
        x, stood, [np.maximum(stood - low, 0), np.maximum(high - stood, 0)], fmt=marker(place),
        color=colour(place), ms=5, lw=0.8, alpha=0.75, label=policy,
    )  # fmt: skip
    low50, high50 = summary["dv50_interval"]
    # Pushes beyond the strongest one tried are beyond the plot.
    ax.axvspan(low50 or 0.0, strongest if high50 is None else high50, color=colour(place), alpha=0.12, lw=0)
    if summary["dv50"] is None:
        return
    grid = np.linspace(0.0, strongest, 200)
    ax.plot(grid, Survival(summary["dv50"], summary["dv50_width"], (0, 0)).chance(grid), **line(place))
    ax.plot([summary["dv50"]], [0.5], marker(place), ms=10, mfc=PAPER, mec=colour(place), mew=2)


def sweep(summaries: Mapping[str, Summary]) -> str | None:
    """Velocity error over a grid of commands, and where a contender falls."""
    shown = {name: summary for name, summary in summaries.items() if summary.get("rows")}
    if not shown:
        return None
    rows = [row for summary in shown.values() for row in summary["rows"]]
    forward, yaw = (sorted({row[axis] for row in rows}) for axis in ("forward_m_s", "yaw_rad_s"))
    errors = [row["lin_vel_rmse"] for row in rows if row["lin_vel_rmse"] is not None]
    most = float(np.percentile(errors, 95)) if errors else 1.0
    with drawing("sweep"):
        figure, axes = axes_grid(1, len(shown), (WIDTH_IN, 3.3), sharey="all")
        for ax, (policy, summary) in zip(axes, shown.items(), strict=True):
            cells = np.full((len(yaw), len(forward)), np.nan)
            for row in summary["rows"]:
                at = yaw.index(row["yaw_rad_s"]), forward.index(row["forward_m_s"])
                cells[at] = np.nan if row["lin_vel_rmse"] is None else row["lin_vel_rmse"]
                _cell_text(ax, at, row, most)
            image = ax.imshow(cells, origin="lower", aspect="auto", cmap="viridis", vmin=0.0, vmax=most)
            ax.set_xticks(range(len(forward)), [f"{value:g}" for value in forward])
            ax.set_yticks(range(len(yaw)), [f"{value:g}" for value in yaw])
            ax.set(title=policy, xlabel="forward, m/s")
            ax.grid(visible=False)
        axes[0].set_ylabel("yaw rate, rad/s")
        figure.colorbar(image, ax=axes, label="velocity error, m/s", extend="max").outline.set_visible(False)
        return to_svg(figure, "Velocity error over commanded forward speed and yaw rate; falls are marked")


def _cell_text(ax: Axes, at: tuple[int, int], row: Summary, most: float) -> None:
    fell = row["falls"] > 0
    error = row["lin_vel_rmse"]
    if error is None:
        text, ink = ("fell" if fell else "", INK)
    else:
        text, ink = (f"{error:.2f}" + ("\nfell" if fell else ""), "white" if error < 0.6 * most else "black")
    ax.text(at[1], at[0], text, ha="center", va="center", fontsize=7.5, color=ink)


def conditions(scenarios: Sequence[tuple[str, Mapping[str, Summary]]]) -> str | None:
    """Velocity error and falls as a condition worsens: one column for each scenario with one level.

    Args:
        scenarios: names of levels, each with the summaries {policy: summary} of its scenario.
    """
    shown = [(level, s) for level, s in scenarios if any(summary.get("rows") for summary in s.values())]
    if not shown:
        return None
    with drawing("conditions"):
        figure, axes = axes_grid(2, len(shown), (WIDTH_IN, 4.2), sharex="col", sharey="row")
        for column, (level, summaries) in enumerate(shown):
            upper, lower = axes[column], axes[len(shown) + column]
            for place, (policy, summary) in enumerate(summaries.items()):
                rows = summary.get("rows", [])
                x = [row[level] for row in rows]
                style = {**line(place), "marker": marker(place), "ms": 4.5, "label": policy}
                error = [np.nan if row["lin_vel_rmse"] is None else row["lin_vel_rmse"] for row in rows]
                upper.plot(x, error, **style)
                lower.plot(x, [100 * row["falls"] / row["episodes"] for row in rows], **style)
            lower.set_xlabel(LEVEL_LABELS.get(level, level.replace("_", " ")))
            lower.set_ylim(-5, 105)
        axes[0].set_ylabel("velocity error, m/s")
        axes[0].set_ylim(bottom=0.0)
        axes[len(shown)].set_ylabel("falls, %")
        legend_above(figure, axes[0], 6)
        return to_svg(figure, "Velocity error and falls against friction, load, motor strength and latency")
