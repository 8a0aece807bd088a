"""The 3-D view of a robot with annotations, and curves of the last seconds beside it."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from footfall.pages.live_curves import LiveCurves
from footfall.pages.marks import Marks
from footfall.pages.moment import Moment
from footfall.pages.scene import WORLD, Scene
from footfall.robots.description import Robot

if TYPE_CHECKING:
    from viser import ViserServer


class View:
    """Shows moments of a robot; sends no commands."""

    def __init__(self, server: "ViserServer", robot: Robot, model: mujoco.MjModel, curves: Any) -> None:
        """`model` is the model to draw; `curves` is the folder or tab for the curves."""
        self._server = server
        self._scene, self._marks = Scene(server, robot, model), Marks(server, robot, WORLD)
        self._curves = LiveCurves(server.gui, curves, robot)

    @property
    def layers(self) -> Mapping[str, Any]:
        """Frames of the scene by label: see `offer_layers`."""
        return self._marks.layers

    def begin(self) -> None:
        """Centre the view at the origin, at the beginning of an episode."""
        self._scene.begin()
        self._marks.begin()

    def stand(self, data: mujoco.MjData) -> None:
        """Draw the robot's bodies alone."""
        self._scene.show(data, np.zeros(3), np.zeros(3), follow=False)

    def show(self, data: mujoco.MjData, moment: Moment, velocity: np.ndarray, follow: bool) -> None:
        """Draw a moment.

        Args:
            data: poses of all bodies.
            moment: moment of the same robot.
            velocity: smoothed, of the base, body frame, m/s, (3,).
            follow: whether the view follows the robot.
        """
        self._scene.show(data, moment.command, velocity, follow)
        with self._server.atomic():
            self._marks.show(moment)
        self._curves.add(moment)
