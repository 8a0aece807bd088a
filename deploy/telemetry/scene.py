"""Markers in `odom`: balance of a walking robot, foot forces and planned footholds."""

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.errors import UserError
from footfall.common.rotations import heading_matrix, rotation_matrix, yaw_of
from footfall.deploy.telemetry.markers import Marker, arrow, disc, line, marker_array, sphere
from footfall.deploy.telemetry.messages import ODOM
from footfall.robots.balance import Balance, BalanceModel
from footfall.robots.description import load_robot
from footfall.robots.readings import Sensed
from footfall.robots.rigid_body import nominal_body

EVERY_NS = 50_000_000  # at most 20 Hz; every third odometry at 50 Hz, so 17 Hz
TRAIL = 20  # number of a foot's latest positions shown as its path
WEIGHT_ARROW_M = 0.4  # length of the arrow for a force equal to the robot's weight
AHEAD_S = 0.5  # the arrow of a velocity shows the travel in this time

RED, GREEN, BLUE = (0.85, 0.2, 0.2, 1.0), (0.2, 0.65, 0.3, 1.0), (0.2, 0.4, 0.85, 1.0)
ORANGE, VIOLET, GREY = (0.95, 0.6, 0.1, 1.0), (0.55, 0.3, 0.75, 1.0), (0.5, 0.5, 0.5, 1.0)


class Scene:
    """Computes the markers of one robot."""

    def __init__(self, folder: str, digest: str, put: Callable[[str, int, bytes], None]) -> None:
        """Load the robot's model.

        Raises:
            UserError: the robot's folder is not there any more, or has changed.
        """
        robot = load_robot(Path(folder))
        if robot.digest != digest:
            raise UserError(f"{folder} has changed")
        self._model, self._put = BalanceModel(robot), put
        self._metres_per_newton = WEIGHT_ARROW_M / (nominal_body(robot).mass * GRAVITY_M_S2)
        self._trails = [deque[Any](maxlen=TRAIL) for _ in robot.description.feet]
        self._next_ns = 0

    def show(
        self, time_ns: int, sensed: Sensed, odometry: np.ndarray, contact: np.ndarray,
        footholds: np.ndarray | None, command: np.ndarray,
    ) -> None:  # fmt: skip
        """Publish the markers if due.

        Args:
            time_ns: time of the readings.
            sensed: readings.
            odometry: numbers of a nav_msgs/Odometry, (85,).
            contact: (feet,) probability that each foot stands.
            footholds: (feet, 3) m, see `PlansFootholds`; None if none are planned.
            command: (3,) forward m/s, leftward m/s, yaw rad/s.
        """
        if time_ns < self._next_ns:
            return
        self._next_ns = time_ns + EVERY_NS
        position, velocity = odometry[:3], odometry[43:46]
        quaternion = np.roll(odometry[3:7], 1)
        balance = self._model.at(position, quaternion, velocity, sensed, contact)
        markers = self._balance_markers(balance)
        yaw = yaw_of(quaternion.tolist())
        if footholds is not None:
            markers += self._foothold_markers(position + footholds @ heading_matrix(yaw).T)
        start = position + np.array([0.0, 0.0, 0.15])
        commanded = heading_matrix(yaw) @ np.array([command[0], command[1], 0.0])
        markers += [
            arrow("commanded_velocity", start, start + AHEAD_S * commanded, GREEN),
            arrow("velocity", start, start + AHEAD_S * rotation_matrix(quaternion) @ velocity, BLUE),
        ]
        self._put("/markers", time_ns, marker_array(time_ns, ODOM, markers))

    def _balance_markers(self, balance: Balance) -> list[Marker]:
        markers = [
            sphere("centre_of_mass", balance.centre, 0.04, ORANGE),
            disc("capture_point", balance.capture, 0.05, VIOLET),
        ]
        if len(balance.support):
            markers.append(line("support_polygon", [*balance.support, balance.support[0]], GREY))
        for index, (foot, force) in enumerate(zip(balance.foot, balance.force, strict=True)):
            self._trails[index].append(foot)
            markers.append(line("foot_paths", list(self._trails[index]), BLUE, index))
            if force.any():
                markers.append(arrow("forces", foot, foot + self._metres_per_newton * force, RED, index))
        return markers

    def _foothold_markers(self, positions: np.ndarray) -> list[Marker]:
        planned = [
            (index, position) for index, position in enumerate(positions) if np.isfinite(position).all()
        ]
        markers = [disc("footholds", position, 0.06, GREEN, index) for index, position in planned]
        paths = [
            (index, self._trails[index][-1], position) for index, position in planned if self._trails[index]
        ]
        return markers + [line("swings", [foot, position], GREEN, index) for index, foot, position in paths]
