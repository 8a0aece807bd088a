"""The panel: commands, state and curves beside the 3-D view."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from footfall.pages.curves import Curves
from footfall.pages.metrics_file import MetricsFile
from footfall.pages.snapshots import NEWEST
from footfall.robots.commands import CommandRange

if TYPE_CHECKING:
    from viser import ClientHandle, GuiSliderHandle, ViserServer

CURVES_WIDTH_PX = 320
PUSHES_M_S = (0.2, 4.0)
RANGES_NOTE = "The policy was trained on these ranges; a number beyond one is clipped to it."
ALL_VISITORS = -1  # key of the curves that every visitor sees
PHONE_PX = 576  # largest width of the view on a phone
PANELS_ASPECT = 0.7  # a view with a smaller aspect ratio is narrow because of the two panels beside it


class Panel:
    """Controls, status and curves of a page. The walk reads the controls once a frame."""

    def __init__(self, server: "ViserServer") -> None:
        self._server, self._gui = server, server.gui
        self._status = self._gui.add_markdown("")
        self._sliders: list[GuiSliderHandle[float]] = []
        self._push_requested = self._restart_requested = False
        self._commands = self._gui.add_folder("Command", visible=False)
        with self._commands:
            self._gui.add_markdown(RANGES_NOTE, order=-0.5)
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
        push.on_click(lambda _: setattr(self, "_push_requested", True))
        restart.on_click(lambda _: setattr(self, "_restart_requested", True))
        curves = self._gui.add_panel()
        self._curves = {ALL_VISITORS: Curves(self._gui, curves.add_tab("Training"))}
        self.live_curves = curves.add_tab("Now")  # container of the walking robot's curves
        curves.dock_left()
        curves.set_width(CURVES_WIDTH_PX)
        server.on_client_connect(self._add_curves)
        server.on_client_disconnect(self._drop_curves)

    def offer_commands(self, ranges: CommandRange) -> None:
        """Show the controls, with sliders over the commands that the policy was trained on."""
        rows = (
            ("Forward, m/s", ranges.forward_m_s, 0.5),
            ("Left, m/s", ranges.leftward_m_s, 0.0),
            ("Yaw, rad/s", ranges.yaw_rad_s, 0.0),
        )
        with self._commands:
            self._sliders = [
                self._gui.add_slider(label, low, high, 0.05, float(np.clip(initial, low, high)), order=-1.0)
                for label, (low, high), initial in rows
            ]
        for slider in (*self._sliders, self._push_m_s):
            slider.on_update(lambda event: _keep_within_range(event.target))
        self._commands.visible = True

    def offer_policies(self, names: Sequence[str]) -> None:
        """Set the policies that the visitor can choose."""
        if self._policy.options != tuple(names):
            self._policy.options = tuple(names)

    @property
    def policy(self) -> str:
        """Name of the chosen policy."""
        return self._policy.value

    @property
    def command(self) -> np.ndarray:
        """Forward m/s, leftward m/s, yaw rad/s, (3,), within the policy's trained ranges."""
        return np.array([_within_range(slider) for slider in self._sliders])

    @property
    def paused(self) -> bool:
        """Whether the simulation is paused: on request, and while no page is open."""
        return self._pause.value or not self.visited

    @property
    def visited(self) -> bool:
        """Whether a page is open."""
        return bool(self._server.get_clients())

    @property
    def follow(self) -> bool:
        return self._follow.value

    def take_push(self) -> float:
        """Speed of the push requested since the last call, m/s; 0 without a request."""
        requested, self._push_requested = self._push_requested, False
        return _within_range(self._push_m_s) if requested else 0.0

    def take_restart(self) -> bool:
        """Whether a restart was requested since the last call."""
        requested, self._restart_requested = self._restart_requested, False
        return requested

    def show_status(self, markdown: str) -> None:
        """Show the status."""
        if self._status.content != markdown:
            self._status.content = markdown

    def draw(self, metrics: MetricsFile, finished: bool) -> None:
        """Draw the curves of all metrics that the run has."""
        for curves in list(self._curves.values()):  # a copy: visitors connect in another thread
            curves.draw(metrics, finished)

    def _add_curves(self, client: "ClientHandle") -> None:
        """Add curves below the controls on a phone, where viser shows the main panel only."""
        if client.camera.image_width < PHONE_PX and client.camera.aspect > PANELS_ASPECT:
            self._curves[client.client_id] = Curves(client.gui, client.gui.add_folder("Curves"))

    def _drop_curves(self, client: "ClientHandle") -> None:
        self._curves.pop(client.client_id, None)


def _keep_within_range(slider: "GuiSliderHandle[float]") -> None:
    """Clamp a number that was typed beside a slider."""
    clamped = _within_range(slider)
    if clamped != slider.value:
        slider.value = clamped  # type: ignore[misc]


def _within_range(slider: "GuiSliderHandle[float]") -> float:
    """A slider's value within its range; a client that is not a browser may send any value."""
    try:
        value = float(slider.value)
    except (TypeError, ValueError):
        value = np.nan
    return float(np.clip(value if np.isfinite(value) else 0.0, slider.min, slider.max))
