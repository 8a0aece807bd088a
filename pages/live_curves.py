"""Curves of the last seconds: commanded and measured velocity, tilt, and the largest joint load."""

from collections import deque
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from footfall.common import colours
from footfall.common.rotations import tilt
from footfall.pages.moment import Moment
from footfall.robots.description import Robot

if TYPE_CHECKING:
    from viser import GuiApi

WINDOW_S = 10.0
DRAW_INTERVAL_S = 0.1  # between drawings
HEIGHT_PX = 120


class Line(NamedTuple):
    """One line of a chart."""

    label: str
    colour: np.ndarray


MEASURED, COMMANDED = Line("measured", colours.VELOCITY), Line("command", colours.COMMAND)
CHARTS: dict[str, tuple[Line, ...]] = {
    "Forward, m/s": (MEASURED, COMMANDED),
    "Left, m/s": (MEASURED, COMMANDED),
    "Yaw, rad/s": (MEASURED, COMMANDED),
    "Tilt, rad": (Line("tilt", colours.CAPTURE),),
    "Hardest joint, % of its torque": (Line("torque", colours.FORCE),),
}


class LiveCurves:
    """Charts of a walking robot, in one container of the page."""

    def __init__(self, gui: "GuiApi", parent: Any, robot: Robot) -> None:
        """`parent` is a folder or tab."""
        self._gui, self._parent = gui, parent
        self._max_nm = robot.motor.peak_torque
        self._values: deque[list[float]] = deque()
        self._charts: list[Any] = []
        self._next_s = 0.0

    def add(self, moment: Moment) -> None:
        """Add a moment; draws every `DRAW_INTERVAL_S`."""
        values, time_s = self._values, moment.time_s
        if values and time_s < values[-1][0]:  # a new episode
            values.clear()
            self._next_s = 0.0
        measured, command = moment.command_velocity.tolist(), np.asarray(moment.command).tolist()
        velocities = [value for pair in zip(measured, command, strict=True) for value in pair]
        max_load = 100.0 * float((np.abs(moment.sensed.joint_torque) / self._max_nm).max())
        values.append([time_s, *velocities, float(tilt(moment.quaternion)), max_load])
        while values[0][0] < time_s - WINDOW_S:
            values.popleft()
        if time_s >= self._next_s and len(values) > 1:
            self._next_s = time_s + DRAW_INTERVAL_S
            self._draw(np.array(values).T)

    def _draw(self, rows: np.ndarray) -> None:
        if not self._charts:
            with self._parent:
                self._charts = [self._chart(title, lines, rows[:1]) for title, lines in CHARTS.items()]
        times_s = rows[0] - rows[0, -1]  # a live run's times are Unix times, too long for an axis
        row = 1
        for chart, lines in zip(self._charts, CHARTS.values(), strict=True):
            chart.data = (times_s, *rows[row : row + len(lines)])
            row += len(lines)

    def _chart(self, title: str, lines: tuple[Line, ...], times_s: np.ndarray) -> Any:
        from viser import uplot

        hidden = uplot.Series_Points(show=False)
        series = [
            uplot.Series(label=line.label, stroke=_css(line.colour), width=2, points=hidden) for line in lines
        ]
        return self._gui.add_uplot(
            (times_s[0], *[np.zeros_like(times_s[0])] * len(lines)),
            (uplot.Series(label="s"), *series),
            title=title,
            scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
            axes=(uplot.Axis(size=28), uplot.Axis(size=52, space=20)),
            legend=uplot.Legend(show=False),
            height=HEIGHT_PX,
            padding=(9, 18, 0, 0),
        )


def _css(rgba: np.ndarray) -> str:
    return "#{:02x}{:02x}{:02x}".format(*(round(255 * float(part)) for part in rgba[:3]))
