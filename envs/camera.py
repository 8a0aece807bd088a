"""Pictures of a robot, for the gymnasium environments."""

import atexit
import os
import weakref

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.description import Robot
from footfall.robots.model import plant_model

WIDTH, HEIGHT = 480, 320


class Camera:
    """Pictures of a robot, from a camera that follows it. The first picture creates the renderer."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._renderer: mujoco.Renderer | None = None

    def picture(self, qpos: np.ndarray) -> np.ndarray:
        """The robot in this position, (height, width, 3) bytes.

        Raises:
            UserError: nothing can be rendered here.
        """
        if self._renderer is None:
            self._model = plant_model(self._robot)
            self._data, self._view = mujoco.MjData(self._model), mujoco.MjvCamera()
            self._renderer = offscreen_renderer(self._model)
            # Close an open camera at exit, before MuJoCo shuts EGL down.
            atexit.register(_close, weakref.ref(self))
        self._data.qpos[:] = qpos
        mujoco.mj_forward(self._model, self._data)
        self._view.lookat[:] = self._data.body(self._robot.description.base).xpos
        self._view.distance = 5 * self._robot.description.standing_height_m
        self._renderer.update_scene(self._data, self._view)
        return self._renderer.render().copy()

    def close(self) -> None:
        """Free the renderer; the next picture creates a new one."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def _close(reference: "weakref.ref[Camera]") -> None:
    camera = reference()
    if camera is not None:
        camera.close()


def offscreen_renderer(model: mujoco.MjModel) -> mujoco.Renderer:
    """A renderer of pictures (HEIGHT, WIDTH).

    Raises:
        UserError: the graphics library that MUJOCO_GL names does not work here.
    """
    try:
        return mujoco.Renderer(model, HEIGHT, WIDTH)
    except Exception as error:  # its type depends on the library
        back_end = os.environ.get("MUJOCO_GL")
        raise UserError(
            f"cannot render here with {f'MUJOCO_GL={back_end}' if back_end else 'MUJOCO_GL not set'}:"
            " without a screen set MUJOCO_GL=egl or MUJOCO_GL=osmesa before Python starts,"
            f" whichever footfall doctor finds to work ({error})"
        ) from None
