"""Annotations of a robot: footholds and paths of its feet, contacts and forces, balance."""

from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np

from footfall.common import colours
from footfall.common.constants import GRAVITY_M_S2
from footfall.common.rotations import heading_matrix, yaw_of
from footfall.pages.moment import Moment
from footfall.robots.balance import CONTACT_THRESHOLD, Balance, BalanceModel
from footfall.robots.description import Robot

if TYPE_CHECKING:
    from viser import ViserServer

LAYERS = {"Footholds, paths": "feet", "Forces": "forces", "Balance": "balance"}
REBUILD_INTERVAL_S = 0.06  # between changes of lines and surfaces, which a browser rebuilds each time
TRAIL_POINTS = 24  # of each foot's path, one for each moment
PATH_POINTS = 9  # of the path to a foothold
MAX_CORNERS = 24  # of the support polygon, at most
FLAT_M = 0.002  # height of flat marks above the ground
UP = np.array([0.0, 0.0, FLAT_M])
FORCE_LENGTH = 1.2  # length of the arrow for the robot's whole weight, in standing heights
LIFT = 0.15  # rise of the path to a foothold, in standing heights


class Marks:
    """Draws a robot's footholds, forces and balance. Each layer can be hidden.

    Layers follow the robot; their coordinates are relative to the point on the ground below it.
    """

    def __init__(self, server: "ViserServer", robot: Robot, world: str) -> None:
        """`world` is the path of the scene's frame in which moments are given."""
        self._scene, self._model = server.scene, BalanceModel(robot)
        self._height = robot.description.standing_height_m
        self._m_per_n = FORCE_LENGTH * self._height / (GRAVITY_M_S2 * robot.legs.mass)
        self._trail: deque[np.ndarray] = deque(maxlen=TRAIL_POINTS)
        self._rebuilt_s = -np.inf
        self.layers = {
            label: self._scene.add_frame(f"{world}/{name}", show_axes=False) for label, name in LAYERS.items()
        }
        feet, forces, balance = (f"{world}/{name}" for name in LAYERS.values())
        small = 0.06 * self._height
        foot_count = len(robot.description.feet)
        self._goals = [self._disc(f"{feet}/goal_{k}", 1.3 * small, colours.PLAN) for k in range(foot_count)]
        self._contacts = [
            self._disc(f"{forces}/contact_{k}", 1.6 * small, colours.FORCE) for k in range(foot_count)
        ]
        self._foothold_paths = self._lines(f"{feet}/paths", colours.PLAN, foot_count * (PATH_POINTS - 1))
        self._trails = self._lines(f"{feet}/trails", colours.VELOCITY, foot_count * (TRAIL_POINTS - 1))
        self._forces = self._scene.add_arrows(
            f"{forces}/arrows", np.zeros((foot_count, 2, 3)), _bytes(colours.FORCE),
            shaft_radius=0.25 * small, head_radius=0.6 * small, head_length=1.2 * small,
        )  # fmt: skip
        self._centre = self._scene.add_icosphere(
            f"{balance}/centre", small, _bytes(colours.CENTRE), opacity=0.9, cast_shadow=False
        )
        self._capture = self._disc(f"{balance}/capture", small, colours.CAPTURE, visible=True)
        self._plumb = self._lines(f"{balance}/plumb", colours.CENTRE, 1)
        self._support_edge = self._lines(f"{balance}/edge", colours.SUPPORT, MAX_CORNERS)
        triangles = np.array([(0, k, k + 1) for k in range(1, MAX_CORNERS - 1)], dtype=np.uint32)
        self._support = self._scene.add_mesh_simple(
            f"{balance}/support", np.zeros((MAX_CORNERS, 3), np.float32), triangles,
            color=_bytes(colours.SUPPORT), opacity=float(colours.SUPPORT[3]), side="double",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def begin(self) -> None:
        """Clear the paths of the feet, at the beginning of an episode."""
        self._trail.clear()
        self._rebuilt_s = -np.inf

    def show(self, moment: Moment) -> None:
        """Draw a moment."""
        balance = self._model.at(
            moment.position, moment.quaternion, moment.velocity, moment.sensed, moment.contact
        )
        self._trail.append(balance.foot)
        below = moment.position * (1.0, 1.0, 0.0)
        standing_feet = moment.contact > CONTACT_THRESHOLD
        goals = _footholds(moment) - below
        for layer in self.layers.values():
            layer.position = below
        for disc, goal in zip(self._goals, goals, strict=True):
            disc.visible = bool(np.isfinite(goal).all())
            if disc.visible:
                disc.position = goal
        for disc, foot, standing in zip(
            self._contacts, balance.foot - below + UP, standing_feet.tolist(), strict=True
        ):
            disc.visible, disc.position = standing, foot
        self._centre.position, self._capture.position = balance.centre - below, balance.capture - below + UP
        if moment.time_s - self._rebuilt_s >= REBUILD_INTERVAL_S:
            self._rebuilt_s = moment.time_s
            self._rebuild(balance, goals, below)

    def _rebuild(self, balance: Balance, goals: np.ndarray, below: np.ndarray) -> None:
        """Draw lines and surfaces; unused segments have no length."""
        feet = balance.foot - below
        trail = np.array(self._trail) - below
        trail = np.concatenate([np.repeat(trail[:1], TRAIL_POINTS - len(trail), axis=0), trail])
        self._trails.points = np.stack([trail[:-1], trail[1:]], axis=2).reshape(-1, 2, 3)
        ends = np.where(np.isfinite(goals), goals, feet)
        paths = [_arc(foot, end, LIFT * self._height) for foot, end in zip(feet, ends, strict=True)]
        self._foothold_paths.points = np.concatenate(paths)
        self._forces.points = np.stack([feet, feet + self._m_per_n * balance.force], axis=1)
        centre, capture = balance.centre - below, balance.capture - below
        self._plumb.points = np.array([[centre, [*centre[:2], capture[2]]]])
        corners = balance.support[:MAX_CORNERS] - below + UP
        if not len(corners):
            corners = capture[None] + UP
        corners = np.concatenate([corners, np.repeat(corners[-1:], MAX_CORNERS - len(corners), axis=0)])
        self._support.vertices = corners
        self._support_edge.points = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)

    def _disc(self, name: str, radius: float, colour: np.ndarray, visible: bool = False) -> Any:
        return self._scene.add_cylinder(
            name, radius, FLAT_M, _bytes(colour), radial_segments=24, opacity=0.85, cast_shadow=False,
            visible=visible,
        )  # fmt: skip

    def _lines(self, name: str, colour: np.ndarray, count: int) -> Any:
        return self._scene.add_line_segments(
            name, np.zeros((count, 2, 3)), _bytes(colour), thickness=2.5, thickness_units="screen"
        )


def _footholds(moment: Moment) -> np.ndarray:
    """Planned footholds in the world, (feet, 3) m; NaN for feet without one."""
    if moment.footholds is None:
        return np.full((len(moment.contact), 3), np.nan)
    return moment.position + moment.footholds @ heading_matrix(yaw_of(moment.quaternion.tolist())).T


def _arc(start: np.ndarray, end: np.ndarray, height_m: float) -> np.ndarray:
    """Segments (k, 2, 3) of an arc from start to end; short arcs rise less."""
    share = np.linspace(0.0, 1.0, PATH_POINTS)[:, None]
    arc = start + share * (end - start)
    rise = min(height_m, 0.5 * float(np.linalg.norm(end - start)))
    arc[:, 2:] += 4.0 * rise * share * (1.0 - share)
    return np.stack([arc[:-1], arc[1:]], axis=1)


def _bytes(rgba: np.ndarray) -> tuple[int, int, int]:
    red, green, blue = (round(255 * float(part)) for part in rgba[:3])
    return red, green, blue
