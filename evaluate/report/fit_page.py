"""A self-contained HTML page of a fit: estimates, intervals, residuals, misfit, provenance."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.ticker import NullFormatter

from footfall.evaluate.provenance import machine
from footfall.evaluate.report.sheet import rendered
from footfall.evaluate.report.svg import INK, Panel, Plot, line

MAX_WINDOWS = 4  # number of windows shown for each joint: those with the largest errors
SPACING_S = 1.1  # between the starts of two shown windows, which last 1 s
FITTED, NOMINAL = 0, 1  # indices of their line styles


@dataclass(frozen=True)
class EstimateRow:
    """One estimated parameter."""

    owner: str  # joint or body
    quantity: str
    value: float
    low: float
    high: float
    nominal: float
    unit: str


@dataclass(frozen=True)
class JointTrack:
    """One joint's held-out motion in W windows of R readings."""

    name: str
    time_s: np.ndarray  # (W, R) from each window's start
    measured_rad: np.ndarray  # (W, R)
    fitted_rad: np.ndarray  # (W, R)
    nominal_rad: np.ndarray  # (W, R)
    noise_rad: float  # of the readings
    misfit: float  # residual of the fit over the noise


@dataclass(frozen=True)
class LegPart:
    """One leg's part of the page."""

    name: str
    verdicts: Sequence[str]
    good: bool
    estimates: Sequence[EstimateRow]
    undetermined: Sequence[tuple[str, str]]  # undetermined parameter, and what it is correlated with
    joints: Sequence[JointTrack]
    effects: Sequence[tuple[str, float]] = ()  # after a misfit: added effect, residual over noise
    profile: tuple[np.ndarray, np.ndarray] | None = None  # shifts of the delay, s; residual over noise


def render(title: str, headline: str, legs: Sequence[LegPart], about: Sequence[tuple[str, str]]) -> str:
    """The page.

    Args:
        title: title of the page.
        headline: the result in one line.
        legs: the fitted legs.
        about: names and values of the provenance.
    """
    return rendered(
        "fit.html",
        title=title,
        headline=headline,
        good=all(leg.good for leg in legs),
        legs=[(leg, [plot for plot in plots(leg) if plot.panels]) for leg in legs],
        about=[*about, ("machine", machine())],
    )


def plots(leg: LegPart) -> list[Plot]:
    """Plots of a leg's intervals, motion, residuals and delay profile."""
    return [_intervals(leg), _motion(leg), _residuals(leg), _profile(leg)]


def _intervals(leg: LegPart) -> Plot:
    """Estimates with their intervals and the nominal value, one panel per quantity."""
    panels = []
    for quantity in dict.fromkeys(row.quantity for row in leg.estimates):
        rows = [row for row in leg.estimates if row.quantity == quantity]
        with Panel(f"interval-{leg.name}-{quantity}", height=60.0 + 28.0 * len(rows)) as panel:
            ax, heights = panel.axes, np.arange(len(rows))
            for y, row in zip(heights, rows, strict=True):
                ax.plot([row.low, row.high], [y, y], **line(FITTED))
                ax.plot(row.value, y, "o", color=line(FITTED)["color"], ms=5)
            ax.axvline(rows[0].nominal, color=INK, lw=0.8, dashes=(4, 3))
            ax.set_yticks(heights, [row.owner for row in rows])
            ax.set(title=f"{quantity}, {rows[0].unit}", ylim=(len(rows) - 0.5, -0.5))
            panels.append(panel.svg(f"{quantity} of each joint or body with its interval"))
    caption = "Blue: estimate and interval of 95 %. Dashed: the nominal value."
    return Plot("Estimates", caption, panels)


def _motion(leg: LegPart) -> Plot:
    """The worst held-out windows of each joint."""
    panels = []
    for joint in leg.joints:
        error = ((joint.fitted_rad - joint.measured_rad) ** 2).mean(axis=1)
        worst = np.sort(np.argsort(-error, kind="stable")[:MAX_WINDOWS])
        with Panel(f"motion-{joint.name}") as panel:
            for place, window in enumerate(worst):
                time_s = joint.time_s[window] + SPACING_S * place
                panel.axes.plot(time_s, joint.measured_rad[window], color=INK, lw=2.4, alpha=0.35)
                panel.axes.plot(time_s, joint.nominal_rad[window], **line(NOMINAL))
                panel.axes.plot(time_s, joint.fitted_rad[window], **line(FITTED))
            panel.axes.set(title=joint.name, xlabel="time, s", ylabel="rad")
            panels.append(panel.svg(f"Held-out motion of {joint.name}: measured, fitted and nominal"))
    caption = (
        f"The {MAX_WINDOWS} held-out windows with the largest errors, side by side. Grey: measured."
        " Blue: fitted leg. Orange: nominal leg. Each window starts from its best-fitting position and speed."
    )
    return Plot("Held-out motion", caption, panels)


def _residuals(leg: LegPart) -> Plot:
    """Error of each held-out window."""
    panels = []
    for joint in leg.joints:
        with Panel(f"residual-{joint.name}", height=190.0) as panel:
            for style, predicted in ((NOMINAL, joint.nominal_rad), (FITTED, joint.fitted_rad)):
                error = 1e3 * np.sqrt(((predicted - joint.measured_rad) ** 2).mean(axis=1))
                panel.axes.plot(np.arange(len(error)), error, marker=".", **line(style))
            panel.axes.axhline(1e3 * joint.noise_rad, color=INK, lw=0.8, dashes=(4, 3))
            panel.axes.set(title=joint.name, xlabel="window", ylabel="rms error, mrad", yscale="log")
            panel.axes.yaxis.set_major_formatter("{x:g}")
            panel.axes.yaxis.set_minor_formatter(NullFormatter())
            panels.append(panel.svg(f"Errors of held-out windows of {joint.name}"))
    return Plot(
        "Residuals", "Blue: the fitted leg. Orange: the nominal one. Dashed: noise of the readings.", panels
    )


def _profile(leg: LegPart) -> Plot:
    """Residual against a shift of the delay."""
    panels: list[Markup] = []
    if leg.profile is not None:
        shift_s, misfit = leg.profile
        with Panel(f"profile-{leg.name}", height=190.0) as panel:
            panel.axes.plot(1e3 * shift_s, misfit, marker="o", **line(FITTED))
            panel.axes.set(xlabel="shift of all delays, ms", ylabel="residual over noise", title=leg.name)
            panels.append(panel.svg("Residual of fits with the delay held"))
    caption = (
        "Fits with the delay held at other values. A flat curve: other parameters compensate for the delay."
    )
    return Plot("Profile over the delay", caption, panels)
