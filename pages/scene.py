"""The 3-D view: the robot's bodies on a moving grid, and arrows for velocities."""

from typing import TYPE_CHECKING

import mujoco
import numpy as np

from footfall.common import colours
from footfall.pages.geometry import Shape, visible_shapes
from footfall.robots.description import Robot

if TYPE_CHECKING:
    from viser import ClientHandle, ViserServer

WORLD = "/world"
GREY = (150, 156, 164)  # visible on light and dark pages
NARROW_ASPECT = 0.9  # aspect ratio (width over height) below which the camera moves back
MIN_CHANNEL = 0.24  # smallest value of a shape's colour channels: black legs are invisible on a dark page
FLAT_SHADED = (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER)
ARROW_S = 0.4  # an arrow is as long as the distance covered in this time
FOLLOW_SHARE = 0.1  # share of the distance to the robot by which the view moves in a frame


class Scene:
    """Draws a model's state. To follow, the world moves, since the visitor controls the camera."""

    def __init__(self, server: "ViserServer", robot: Robot, model: mujoco.MjModel) -> None:
        self._server = server
        scene, height = server.scene, robot.description.standing_height_m
        self._height = height
        self._viewpoint = np.array([2.2, -3.4, 1.9]) * height
        self._base = int(model.body(robot.description.base).id)
        scene.configure_default_lights(enabled=True, cast_shadow=True)
        self._world = scene.add_frame(WORLD, show_axes=False)
        scene.add_grid(
            f"{WORLD}/ground", width=200.0, height=200.0, cell_size=0.5, section_size=2.5,
            cell_color=GREY, section_color=GREY, cell_thickness=0.6, section_thickness=1.4,
            plane_color=GREY, plane_opacity=0.15, shadow_opacity=0.35, fade_distance=14.0, fade_strength=1.5,
        )  # fmt: skip
        shapes = visible_shapes(model)
        self.bodies = {  # frames of the bodies by id; geoms are their children
            body: scene.add_frame(_frame_of(body), show_axes=False)
            for body in sorted({shape.body for shape in shapes})
        }
        for shape in shapes:
            self._add_shape(server, model, shape)
        self._arrows = {
            name: scene.add_arrows(
                f"{WORLD}/{name}", np.zeros((1, 2, 3)), _rgb_bytes(colour), shaft_radius=0.035 * height,
                head_radius=0.08 * height, head_length=0.16 * height, visible=False,
            )
            for name, colour in (("command", colours.COMMAND), ("velocity", colours.VELOCITY))
        }  # fmt: skip
        camera = server.initial_camera
        camera.look_at = (0.0, 0.0, 0.6 * height)
        camera.position = tuple(self._viewpoint)
        server.on_client_connect(self._move_camera_back)
        self._view_centre = np.zeros(3)

    def _move_camera_back(self, client: "ClientHandle") -> None:
        """Move the camera back if the view is narrow, so that the whole robot is visible."""
        if client.camera.aspect < NARROW_ASPECT:
            target = client.camera.look_at  # moving the camera would move its target too
            client.camera.position = self._viewpoint * (NARROW_ASPECT / client.camera.aspect)
            client.camera.look_at = target

    def show(self, data: mujoco.MjData, command: np.ndarray, velocity: np.ndarray, follow: bool) -> None:
        """Draw a state.

        Args:
            data: poses of all bodies.
            command: forward m/s, leftward m/s, yaw rad/s, (3,).
            velocity: velocity of the base, body frame, m/s, (3,).
            follow: whether the view follows the robot.
        """
        with self._server.atomic():  # bodies move together
            for body, frame in self.bodies.items():
                frame.position, frame.wxyz = data.xpos[body], data.xquat[body]
            base = data.xpos[self._base]
            if follow:
                self._view_centre += FOLLOW_SHARE * (base * (1.0, 1.0, 0.0) - self._view_centre)
                self._world.position = -self._view_centre
            heading = _yaw_rotation(data.xmat[self._base].reshape(3, 3))
            for height_share, name, vector in ((0.75, "command", command), (0.95, "velocity", velocity)):
                vector_m = heading @ np.array([vector[0], vector[1], 0.0]) * ARROW_S
                arrow = self._arrows[name]
                arrow.visible = bool(np.linalg.norm(vector_m) > 0.02)
                arrow.position = base + np.array([0.0, 0.0, height_share * self._height])
                arrow.points = np.array([[np.zeros(3), vector_m]], dtype=np.float32)

    def begin(self) -> None:
        """Centre the view at the origin, at the beginning of an episode."""
        self._view_centre = np.zeros(3)
        self._world.position = np.zeros(3)

    def _add_shape(self, server: "ViserServer", model: mujoco.MjModel, shape: Shape) -> None:
        server.scene.add_mesh_simple(
            f"{_frame_of(shape.body)}/geom_{shape.geom}", shape.vertices, shape.faces,
            color=_rgb_bytes(np.maximum(shape.rgba, MIN_CHANNEL)),
            opacity=None if shape.rgba[3] == 1.0 else float(shape.rgba[3]),
            position=shape.position, wxyz=shape.quaternion,
            flat_shading=model.geom_type[shape.geom] in FLAT_SHADED,
        )  # fmt: skip


def _frame_of(body: int) -> str:
    """Scene path of a body's frame, by id, since a name may contain any character."""
    return f"{WORLD}/body_{body}"


def _rgb_bytes(rgba: np.ndarray) -> tuple[int, int, int]:
    red, green, blue = (round(255 * float(part)) for part in rgba[:3])
    return red, green, blue


def _yaw_rotation(rotation: np.ndarray) -> np.ndarray:
    """The yaw part of a rotation (3, 3)."""
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
