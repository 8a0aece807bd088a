"""matplotlib drawings as inline SVG with the page's fonts and colours, light and dark.

A plot consists of panels, each about as wide as a phone's screen, which the page places side by side if there
is room, so that text keeps its size. A panel carries points with numbers, which a script of the page shows
under the pointer.
"""

import io
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import matplotlib as mpl
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.figure import Figure

# Placeholder colours that no plot uses otherwise; in the page they follow its colour scheme.
INK, LINE, PAPER = "#010203", "#040506", "#070809"
IN_PAGE = {INK: "currentColor", LINE: "var(--line)", PAPER: "var(--card)"}
# Okabe and Ito's colours: most colour-blind readers can distinguish them, on white and on black.
COLOURS = ("#2380c2", "#e06000", "#009e73", "#cc79a7", "#b8860b", "#56b4e9")
MARKERS = ("o", "s", "^", "D", "v", "P")
MARKER_PATHS = {  # the same markers around (13, 6), for legends
    "o": "M9 6a4 4 0 1 0 8 0a4 4 0 1 0-8 0",
    "s": "M9.5 2.5h7v7h-7z",
    "^": "M13 1.5L17.5 10h-9z",
    "D": "M13 1.5L17.5 6L13 10.5L8.5 6z",
    "v": "M13 10.5L8.5 2h9z",
    "P": "M11.5 2h3v2.5H17v3h-2.5V10h-3V7.5H9v-3h2.5z",
}
DASHES: tuple[tuple[float, ...] | None, ...] = (None, (5, 2), (2, 1.5), (7, 2, 2, 2), (1, 1), (9, 3))

PIXELS_PER_INCH = 72.0  # an SVG by matplotlib has 72 units to the inch; the page shows one as about a pixel
PANEL_WIDTH, PANEL_HEIGHT = 340.0, 250.0  # units
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "text.parse_math": False,  # a policy's name may hold dollar signs
    "font.size": 11.5,
    "axes.titlesize": 12.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": LINE,
    "axes.labelcolor": INK,
    "axes.facecolor": "none",
    "figure.facecolor": "none",
    "figure.dpi": PIXELS_PER_INCH,
    "text.color": INK,
    "xtick.color": LINE,
    "ytick.color": LINE,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 11.0,
    "ytick.labelsize": 11.0,
    "axes.grid": True,
    "grid.color": LINE,
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "lines.linewidth": 1.6,
}


def colour(index: int) -> str:
    """The colour of the policy with this index."""
    return COLOURS[index % len(COLOURS)]


def marker(index: int) -> str:
    """The marker of the policy with this index."""
    return MARKERS[index % len(MARKERS)]


def line(index: int) -> dict[str, Any]:
    """Line style of the policy with this index: lines differ in colour and dashes."""
    dashes = DASHES[index % len(DASHES)]
    return {"color": colour(index)} | ({} if dashes is None else {"dashes": dashes})


class Reading(NamedTuple):
    """Numbers that a panel shows under the pointer."""

    x: float  # position in data coordinates
    y: float | None  # None: at any height
    text: str


@dataclass(frozen=True)
class Plot:
    """A plot of the report: panels of one size under one heading."""

    title: str
    caption: str
    panels: Sequence[Markup]
    legend: Sequence[int] = ()  # indices of the policies with a line


class Panel:
    """One matplotlib Axes in the page's style; `svg` finishes it.

    with Panel("tracking-0") as panel:
        panel.axes.plot(...)
        plots.append(panel.svg("what it shows"))
    """

    def __init__(self, identity: str, height: float = PANEL_HEIGHT) -> None:
        """`identity` makes the element ids of several panels of one page unique."""
        self._style = mpl.rc_context({**STYLE, "svg.hashsalt": identity})
        self._size = PANEL_WIDTH / PIXELS_PER_INCH, height / PIXELS_PER_INCH
        self._identity = identity

    def __enter__(self) -> "Panel":
        self._style.__enter__()
        self._figure = Figure(figsize=self._size, layout="constrained")
        self.axes: Axes = self._figure.subplots()
        return self

    def __exit__(self, *error: Any) -> None:
        self._style.__exit__(*error)

    def svg(self, label: str, readings: Sequence[Reading] = ()) -> Markup:
        """The drawing as an `<svg>` element with a text alternative, and the numbers for the pointer."""
        buffer = io.StringIO()
        self._figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, dpi=150)
        text = buffer.getvalue()
        text = text[text.index("<svg") :]
        text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
        text = re.sub(r' (width|height)="[\d.]+pt"', "", text, count=2)
        text = re.sub(r'(id="|url\(#|xlink:href="#)', rf"\g<1>{self._identity}-", text)
        for stand_in, in_page in IN_PAGE.items():
            text = text.replace(stand_in, in_page)
        head = f'<svg role="img" aria-label="{escape(label)}"'
        if readings:
            head += f' data-readings="{escape(json.dumps(self._placed(readings)))}"'
        return Markup(text.replace("<svg", head, 1))

    def _placed(self, readings: Sequence[Reading]) -> dict[str, Any]:
        """Readings in the units of the saved drawing, and the rectangle of the axes."""
        height = self._figure.bbox.height
        box = self.axes.get_window_extent()
        bottom = self.axes.get_ylim()[0]
        points = []
        for reading in readings:
            x, y = self.axes.transData.transform((reading.x, bottom if reading.y is None else reading.y))
            points.append([round(x, 1), None if reading.y is None else round(height - y, 1), reading.text])
        rectangle = [box.x0, height - box.y1, box.x1, height - box.y0]
        return {"box": [round(edge, 1) for edge in rectangle], "points": points}
