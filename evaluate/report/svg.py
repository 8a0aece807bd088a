"""matplotlib figures as SVG text that lives inside a page: its fonts, its colours, light and dark."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Stand-ins that no plot uses otherwise; in the page they follow its colour scheme.
INK, LINE, PAPER = "#010203", "#040506", "#070809"
WIDTH_IN = 9.6  # of a plot that spans the page
IN_PAGE = {INK: "currentColor", LINE: "var(--line)", PAPER: "var(--card)"}
# Okabe and Ito's colours, told apart by most colour-blind readers, and seen on white and on black.
COLOURS = ("#2380c2", "#e06000", "#009e73", "#cc79a7", "#b8860b", "#56b4e9")
MARKERS = ("o", "s", "^", "D", "v", "P")
DASHES: tuple[tuple[float, ...] | None, ...] = (None, (5, 2), (2, 1.5), (7, 2, 2, 2), (1, 1), (9, 3))

Sharing = Literal["none", "all", "row", "col"]

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.size": 10.0,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": LINE,
    "axes.labelcolor": INK,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "text.color": INK,
    "xtick.color": LINE,
    "ytick.color": LINE,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "axes.grid": True,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
}


def colour(index: int) -> str:
    """The colour of the contender at this place."""
    return COLOURS[index % len(COLOURS)]


def marker(index: int) -> str:
    """The marker of the contender at this place."""
    return MARKERS[index % len(MARKERS)]


def line(index: int) -> dict[str, Any]:
    """Line style of the contender at this place: never told apart by colour alone."""
    dashes = DASHES[index % len(DASHES)]
    return {"color": colour(index)} | ({} if dashes is None else {"dashes": dashes})


@contextmanager
def drawing(name: str) -> Iterator[None]:
    """The style for what is drawn inside; `name` keeps the ids of several plots of one page apart."""
    with mpl.rc_context({**STYLE, "svg.hashsalt": name}):
        yield


def axes_grid(
    rows: int, columns: int, size: tuple[float, float], sharex: Sharing = "none", sharey: Sharing = "none"
) -> tuple[Figure, list[Axes]]:
    """A figure of a size in inches with rows x columns axes, row by row."""
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey)
    return figure, [axes for row in grid for axes in row]


def legend_above(figure: Figure, axes: Axes, columns: int) -> None:
    """One legend for the whole figure, from the labels of one of its axes."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=columns, handlelength=2.6)


def to_svg(figure: Figure, label: str) -> str:
    """The figure as an `<svg>` element with a text alternative."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, dpi=150)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' (width|height)="[\d.]+pt"', "", text, count=2)
    for stand_in, in_page in IN_PAGE.items():
        text = text.replace(stand_in, in_page)
    return text.replace("<svg", f'<svg role="img" aria-label="{_attribute(label)}"', 1)


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")
