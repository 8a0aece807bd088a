"""Plot for `odometry.py`: drift over distance, and a true and an estimated path of each robot."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

Walk = dict[str, Any]  # as returned by `odometry.follow`

WIDTH_IN, HEIGHT_IN, DPI = 7.0, 7.4, 200  # 1400 pixels wide; the text is readable at 420
COLOURS = ("#2380c2", "#e06000", "#009e73", "#cc79a7", "#b8860b")
PLANT, SHOWN_PATH = "randomised", "rectangle"
PERCENTILES = (5.0, 50.0, 95.0)  # of the walks
REACHED_SHARE = 0.5  # share of the walks that must reach a distance for its percentiles to be shown
STEP_M = 0.05


def drift_over_distance(walks: Sequence[Walk]) -> tuple[np.ndarray, np.ndarray]:
    """Distances (k,) m, and the `PERCENTILES` of the position error after each, (3, k) m.

    Each walk counts up to its length; distances reached by fewer than `REACHED_SHARE` of the walks are
    omitted.
    """
    curves = []
    for walk in walks:
        true, error = (np.array([row[key] for row in walk["rows"]])[:, :2] for key in ("true", "error"))
        walked = np.concatenate([[0.0], np.linalg.norm(np.diff(true, axis=0), axis=1).cumsum()])
        curves.append((walked, np.linalg.norm(error, axis=1)))
    reached = np.sort([walked[-1] for walked, _ in curves])[::-1]
    farthest = reached[max(0, int(np.ceil(REACHED_SHARE * len(curves))) - 1)]
    distance = np.arange(0.0, farthest, STEP_M)
    errors = np.array([np.interp(distance, walked, error, right=np.nan) for walked, error in curves])
    return distance, np.nanpercentile(errors, PERCENTILES, axis=0)


def typical(walks: Sequence[Walk]) -> Walk:
    """The walk with the median drift; of an even number, the lower of the two in the middle."""
    return sorted(walks, key=lambda walk: walk["drift_percent"])[(len(walks) - 1) // 2]


def plot(walks: Sequence[Walk], goal_percent: float, path: Path) -> None:
    """Plot all walks on randomised plants, except those that fell or hardly moved.

    Args:
        walks: walks of any robots.
        goal_percent: drift of the reference line, % of the distance.
        path: image to write.

    Raises:
        ValueError: no walk is left.
    """
    counted = [w for w in walks if w["plant"] == PLANT and not w["fell"] and w["drift_percent"] is not None]
    robots = sorted({walk["robot"] for walk in counted})
    if not robots:
        raise ValueError(f"no walk on {PLANT} plants to plot")
    with plt.rc_context({"font.size": 12, "axes.spines.top": False, "axes.spines.right": False}):
        figure = plt.figure(figsize=(WIDTH_IN, HEIGHT_IN), layout="constrained")
        above, below = figure.subfigures(2, 1, height_ratios=(1.25, 1.0), squeeze=False)[:, 0]
        _draw_drift(above.subplots(), {name: _of(counted, robot=name) for name in robots}, goal_percent)
        panels = np.atleast_1d(below.subplots(1, len(robots)))
        for axes, name, colour in zip(panels, robots, COLOURS, strict=False):
            shown = _of(counted, robot=name, path=SHOWN_PATH) or _of(counted, robot=name)
            learned = [walk for walk in shown if walk["policy"].startswith(f"{name}-")]
            _draw_path(axes, typical(learned or shown), colour)
        figure.savefig(path, dpi=DPI)
        plt.close(figure)


def _of(walks: Sequence[Walk], **conditions: str) -> list[Walk]:
    return [walk for walk in walks if all(walk[key] == value for key, value in conditions.items())]


def _draw_drift(axes: Axes, walks: dict[str, list[Walk]], goal_percent: float) -> None:
    farthest = highest = 0.0
    for (name, own), colour in zip(walks.items(), COLOURS, strict=False):
        distance, (low, median, high) = drift_over_distance(own)
        axes.fill_between(distance, 100 * low, 100 * high, color=colour, alpha=0.18, lw=0)
        axes.plot(distance, 100 * median, color=colour, lw=2.5, label=f"{name}, {len(own)} walks")
        farthest, highest = max(farthest, distance[-1]), max(highest, 100 * high.max())
    axes.plot(
        [0, farthest], [0, goal_percent * farthest], "k--", lw=1.2, label=f"{goal_percent:g} % of the way"
    )
    axes.set(xlim=(0, farthest), ylim=(0, 1.05 * highest), xlabel="distance walked, m")
    axes.set_ylabel("position error, cm")
    axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)


def _draw_path(axes: Axes, walk: Walk, colour: str) -> None:
    true, estimated = (np.array([row[key] for row in walk["rows"]])[:, :2].T for key in ("true", "estimated"))
    axes.plot(*true, color=colour, lw=5, alpha=0.35, solid_capstyle="round")
    axes.plot(*estimated, color="black", lw=1.2)
    axes.plot(*true[:, :1], "o", color=colour, ms=8)
    axes.set_title(
        f"{walk['policy']}\n{walk['drift_percent']:.1f} % of {walk['distance_m']:.1f} m", fontsize=12
    )
    axes.set_aspect("equal", adjustable="datalim")
    axes.locator_params(nbins=4)
    axes.set_xlabel("m")
