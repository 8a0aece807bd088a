"""The page: a panel with commands, state and curves beside the 3-D view."""

import errno
import io
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.common.installation import needs_extra
from footfall.pages.metrics_file import MetricsFile, thinned
from footfall.policies.contract import CommandRange

if TYPE_CHECKING:
    from viser import GuiSliderHandle, GuiUplotHandle, ViserServer

NOT_HERE = (errno.EADDRNOTAVAIL, errno.EAFNOSUPPORT)
POINTS = 400  # of a curve, at most
CURVE_HEIGHT_PX = 110
CURVES_WIDTH_PX = 320
BRAND = (224, 112, 26)
COLOUR = "#{:02x}{:02x}{:02x}".format(*BRAND)


class Curve(NamedTuple):
    """One chart: what it says above it, and the metric that it draws."""

    title: str
    metric: str


CURVES = (
    Curve("Reward, per second", "reward/total"),
    Curve("Error of velocity, m/s", "tracking/linear_error_m_s"),
    Curve("Error of yaw rate, rad/s", "tracking/yaw_error_rad_s"),
    Curve("Length of an episode, s", "episode/length_s"),
    Curve("Learning rate", "learning/learning_rate"),
    Curve("Environment steps per second", "speed/steps_per_s"),
)


@contextmanager
def serving(host: str, port: int, label: str) -> "Iterator[ViserServer]":
    """An empty page, served for as long as the context lasts.

    Raises:
        UserError: viser is not installed, or the address cannot be had.
    """
    check_page(host, port)
    from viser import ViserServer

    # A browser that hangs up early, as browsers do, would cost a traceback.
    logging.getLogger("websockets").setLevel(logging.CRITICAL)
    with _quietly():
        server = ViserServer(host, port, label=label, verbose=False)
    try:
        server.gui.main_panel.dock_right()
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND)
        yield server
    finally:
        with _quietly():
            server.stop()


def check_page(host: str, port: int) -> None:
    """Raises UserError if no page can be served there, or none at all."""
    _check_viser()
    _check_address(host, port)


def _check_viser() -> None:
    """Raises UserError if the extra is not installed."""
    with needs_extra("watch", "watching needs"):
        import viser  # noqa: F401


def _check_address(host: str, port: int) -> None:
    """Raises UserError if something cannot listen there; viser would quietly take another port.

    A name may stand for several addresses, and viser takes them all, but for those that this machine does
    not have (IPv6 where it is off).
    """
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except UnicodeError:
        raise _no_page(host, port, "no host can have this name") from None
    except OSError as error:
        raise _no_page(host, port, error.strerror) from None
    refusals = [_refusal(family, kind, protocol, address) for family, kind, protocol, _, address in found]
    errors = [error for error in refusals if error is not None]
    taken = [error for error in errors if error.errno not in NOT_HERE]
    if taken or None not in refusals:
        raise _no_page(host, port, (taken or errors)[0].strerror)


def _refusal(family: int, kind: int, protocol: int, address: tuple) -> OSError | None:
    """Why nothing can listen at one address; None if something can."""
    try:
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            if family == socket.AF_INET6:  # as a server has it that listens for IPv4 besides
                probe.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
            probe.bind(address)
    except OSError as error:
        return error
    return None


def _no_page(host: str, port: int, reason: str | None) -> UserError:
    return UserError(f"cannot serve a page at {host}:{port}: {reason}; give another --host or --port")


def _quietly() -> "redirect_stdout[io.StringIO]":
    """Whatever viser says of itself is said by us in a line."""
    return redirect_stdout(io.StringIO())


class Panel:
    """What the visitor reads and moves. Fields are read by the walk at its own pace."""

    def __init__(self, server: "ViserServer") -> None:
        self._server, self._gui = server, server.gui
        self._status = self._gui.add_markdown("")
        self._sliders: list[GuiSliderHandle[float]] = []
        self._push_asked = self._restart_asked = False
        self._commands = self._gui.add_folder("Command", visible=False)
        with self._commands:
            self._pause = self._gui.add_checkbox("Pause", False)
            self._follow = self._gui.add_checkbox("Follow", True)
            self._push_m_s = self._gui.add_slider("Push, m/s", 0.2, 4.0, 0.1, 1.0)
            push = self._gui.add_button("Push it")
            restart = self._gui.add_button("Start again", color="gray")
        push.on_click(lambda _: setattr(self, "_push_asked", True))
        restart.on_click(lambda _: setattr(self, "_restart_asked", True))
        curves = self._gui.add_panel()
        self._curves = curves.add_tab("Curves")
        with self._curves:
            self._gui.add_markdown("Over million environment steps:")
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
        self._commands.visible = True

    @property
    def command(self) -> np.ndarray:
        """Forward m/s, leftward m/s, yaw rad/s, (3,)."""
        return np.array([slider.value for slider in self._sliders])

    @property
    def paused(self) -> bool:
        """Whether the robot shall hold still: on request, and while nobody looks."""
        return self._pause.value or not self.seen

    @property
    def seen(self) -> bool:
        """Whether anybody has the page open."""
        return bool(self._server.get_clients())

    @property
    def follow(self) -> bool:
        return self._follow.value

    def take_push(self) -> float:
        """Speed of a push that was asked for since the last call, m/s; 0 if none was."""
        asked, self._push_asked = self._push_asked, False
        return self._push_m_s.value if asked else 0.0

    def take_restart(self) -> bool:
        """Whether a new start was asked for since the last call."""
        asked, self._restart_asked = self._restart_asked, False
        return asked

    def say(self, markdown: str) -> None:
        """Show the state of things."""
        if self._status.content != markdown:
            self._status.content = markdown

    def draw(self, metrics: MetricsFile) -> None:
        """Draw the curves of all metrics that the run has."""
        for curve in CURVES:
            steps, values = metrics.curve(curve.metric)
            if len(steps) < 2:
                continue
            data = (thinned(steps / 1e6, POINTS), thinned(values, POINTS))
            if curve.metric in self._charts:
                self._charts[curve.metric].data = data
            else:
                self._charts[curve.metric] = self._chart(curve, data)

    def _chart(self, curve: Curve, data: tuple[np.ndarray, ...]) -> "GuiUplotHandle":
        from viser import uplot

        with self._curves:
            return self._gui.add_uplot(
                data,
                (
                    uplot.Series(label="million steps"),
                    uplot.Series(
                        label=curve.title, stroke=COLOUR, width=2, points=uplot.Series_Points(show=False)
                    ),
                ),
                title=curve.title,
                scales={"x": uplot.Scale(time=False, auto=True), "y": uplot.Scale(auto=True)},
                legend=uplot.Legend(show=False),
                height=CURVE_HEIGHT_PX,
            )
