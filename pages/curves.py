"""The curves of a training, in one container of the page."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from footfall.pages.metrics_file import MetricsFile, thinned
from footfall.pages.page import BRAND

if TYPE_CHECKING:
    from viser import GuiApi, GuiFolderHandle, GuiTabHandle, GuiUplotHandle

MAX_POINTS = 400  # of a curve, at most
HEIGHT_PX = 100
PADDING_PX = (9, 18, 0, 0)  # top, right, bottom, left of a chart; room for the highest tick label
COLOUR = "#{:02x}{:02x}{:02x}".format(*BRAND)
WAITING = "No curves yet: they begin with the second iteration."
NO_METRICS = "No curves: the folder holds the policy without the metrics of its training."
AXIS = "Over million environment steps:"


class Curve(NamedTuple):
    """One chart: title, metric, and the value of one unit of its axis."""

    title: str
    metric: str
    unit: float = 1.0


CURVES = (
    Curve("Reward per second", "reward/total"),
    Curve("Velocity error, m/s", "tracking/linear_error_m_s"),
    Curve("Yaw-rate error, rad/s", "tracking/yaw_error_rad_s"),
    Curve("Episode length, s", "episode/length_s"),
    Curve("Learning rate, thousandths", "learning/learning_rate", 1e-3),
    Curve("Steps per second, thousands", "speed/steps_per_s", 1e3),
)


class Curves:
    """A chart for each metric of the run, or the reason why there is none."""

    def __init__(self, gui: "GuiApi", parent: "GuiTabHandle | GuiFolderHandle") -> None:
        self._gui, self._parent = gui, parent
        self._drawn_step = 0
        self._charts: dict[str, GuiUplotHandle] = {}
        with parent:
            self._text = gui.add_markdown(WAITING)

    def draw(self, metrics: MetricsFile, finished: bool) -> None:
        """Draw new values. A finished run without metrics will have no curves."""
        if metrics.last_step != self._drawn_step:
            self._drawn_step = metrics.last_step
            for curve in CURVES:
                self._draw(curve, *metrics.curve(curve.metric))
        text = AXIS if self._charts else NO_METRICS if finished else WAITING
        if self._text.content != text:
            self._text.content = text

    def _draw(self, curve: Curve, steps: np.ndarray, values: np.ndarray) -> None:
        if len(steps) < 2:
            return
        data = (thinned(steps / 1e6, MAX_POINTS), thinned(values / curve.unit, MAX_POINTS))
        if curve.metric in self._charts:
            self._charts[curve.metric].data = data
        else:
            self._charts[curve.metric] = self._chart(curve, data)

    def _chart(self, curve: Curve, data: tuple[np.ndarray, ...]) -> "GuiUplotHandle":
        from viser import uplot

        with self._parent:
            return self._gui.add_uplot(
                data,
                (
                    uplot.Series(label="million steps"),
                    uplot.Series(
                        label="value", stroke=COLOUR, width=2, points=uplot.Series_Points(show=False)
                    ),
                ),
                title=curve.title,
                scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
                axes=(uplot.Axis(size=28), uplot.Axis(size=44, space=20)),
                legend=uplot.Legend(show=True, live=True),  # the numbers under the pointer
                height=HEIGHT_PX,
                padding=PADDING_PX,
            )
