"""The panel: commands, state and curves beside the 3-D view."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from footfall.pages.metrics_file import MetricsFile, thinned
from footfall.pages.page import BRAND
from footfall.pages.snapshots import NEWEST
from footfall.robots.commands import CommandRange

if TYPE_CHECKING:
    from viser import GuiSliderHandle, GuiUplotHandle, ViserServer

POINTS = 400  # of a curve, at most
CURVE_HEIGHT_PX = 100
CURVES_WIDTH_PX = 320
PADDING_PX = (9, 18, 0, 0)  # top, right, bottom, left of a chart: the highest tick's number is not cut off
COLOUR = "#{:02x}{:02x}{:02x}".format(*BRAND)
PUSHES_M_S = (0.2, 4.0)
BEYOND = "The policy was trained on these ranges; a number beyond one is clipped to it."
NO_CURVES = "No curves yet: they begin with the second iteration."


class Curve(NamedTuple):
    """One chart: title, metric, and the size of its unit."""

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


class Panel:
    """Controls, status and curves of a page. The walk reads the controls once a frame."""

    def __init__(self, server: "ViserServer") -> None:
        self._server, self._gui = server, server.gui
        self._status = self._gui.add_markdown("")
        self._sliders: list[GuiSliderHandle[float]] = []
        self._push_asked = self._restart_asked = False
        self._commands = self._gui.add_folder("Command", visible=False)
        with self._commands:
            self._gui.add_markdown(BEYOND, order=-0.5)
            self._policy = self._gui.add_dropdown(
                "Policy",
                (NEWEST,),
                hint="Checkpoints that the run keeps, and those shown before",
            )
            self._pause = self._gui.add_checkbox("Pause", False)
            self._follow = self._gui.add_checkbox("Follow", True)
            self._push_m_s = self._gui.add_slider("Push, m/s", *PUSHES_M_S, 0.1, 1.0)
            push = self._gui.add_button("Push it")
            restart = self._gui.add_button("Start again", color="gray")
        push.on_click(lambda _: setattr(self, "_push_asked", True))
        restart.on_click(lambda _: setattr(self, "_restart_asked", True))
        curves = self._gui.add_panel()
        self._curves = curves.add_tab("Curves")
        with self._curves:
            self._axis = self._gui.add_markdown(NO_CURVES)
        curves.dock_left()
        curves.set_width(CURVES_WIDTH_PX)
        self._charts: dict[str, GuiUplotHandle] = {}

    def offer_commands(self, ranges: CommandRange) -> None:
        """Show the controls, with sliders over the commands that the policy was trained on."""
        rows = (
            ("Forward, m/s", ranges.forward_m_s, 0.5),
            ("Left, m/s", ranges.leftward_m_s, 0.0),
            ("Yaw, rad/s", ranges.yaw_rad_s, 0.0),
        )
        with self._commands:
            self._sliders = [
                self._gui.add_slider(label, low, high, 0.05, float(np.clip(first, low, high)), order=-1.0)
                for label, (low, high), first in rows
            ]
        for slider in (*self._sliders, self._push_m_s):
            slider.on_update(lambda event: _keep_within_range(event.target))
        self._commands.visible = True

    def offer_policies(self, names: Sequence[str]) -> None:
        """Let the visitor choose among these."""
        if self._policy.options != tuple(names):
            self._policy.options = tuple(names)

    @property
    def policy(self) -> str:
        """The name that was chosen."""
        return self._policy.value

    @property
    def command(self) -> np.ndarray:
        """Forward m/s, leftward m/s, yaw rad/s, (3,), within what the policy was trained on."""
        return np.array([_within_range(slider) for slider in self._sliders])

    @property
    def paused(self) -> bool:
        """Whether the robot holds still: on request, and while no page is open."""
        return self._pause.value or not self.seen

    @property
    def seen(self) -> bool:
        """Whether a page is open."""
        return bool(self._server.get_clients())

    @property
    def follow(self) -> bool:
        return self._follow.value

    def take_push(self) -> float:
        """Speed of the push requested since the last call, m/s; 0 without a request."""
        asked, self._push_asked = self._push_asked, False
        return _within_range(self._push_m_s) if asked else 0.0

    def take_restart(self) -> bool:
        """Whether a restart was requested since the last call."""
        asked, self._restart_asked = self._restart_asked, False
        return asked

    def say(self, markdown: str) -> None:
        """Show the status."""
        if self._status.content != markdown:
            self._status.content = markdown

    def draw(self, metrics: MetricsFile) -> None:
        """Draw the curves of all metrics that the run has."""
        for curve in CURVES:
            steps, values = metrics.curve(curve.metric)
            if len(steps) < 2:
                continue
            data = (thinned(steps / 1e6, POINTS), thinned(values / curve.unit, POINTS))
            if curve.metric in self._charts:
                self._charts[curve.metric].data = data
            else:
                self._charts[curve.metric] = self._chart(curve, data)

    def _chart(self, curve: Curve, data: tuple[np.ndarray, ...]) -> "GuiUplotHandle":
        from viser import uplot

        self._axis.content = "Over million environment steps:"
        with self._curves:
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
                height=CURVE_HEIGHT_PX,
                padding=PADDING_PX,
            )


def _keep_within_range(slider: "GuiSliderHandle[float]") -> None:
    """Clamp a number that was typed beside a slider."""
    within = _within_range(slider)
    if within != slider.value:
        slider.value = within  # type: ignore[misc]


def _within_range(slider: "GuiSliderHandle[float]") -> float:
    """A slider's value within its range; a program that is no browser may send what is no number."""
    try:
        value = float(slider.value)
    except (TypeError, ValueError):
        value = np.nan
    return float(np.clip(value if np.isfinite(value) else 0.0, slider.min, slider.max))
