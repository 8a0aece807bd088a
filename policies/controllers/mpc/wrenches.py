"""Wrench of the ground on each foot: a force, and a moment for a sole."""

from typing import NamedTuple

import numpy as np

from footfall.robots.description import Robot


class Wrenches(NamedTuple):
    """Wrench of the ground on each foot, at the middle of its contact."""

    force: np.ndarray  # (legs, 3) N
    moment: np.ndarray  # (legs, 3) N m; 0 for point feet

    def dot(self, matrix: np.ndarray) -> "Wrenches":
        """The same wrenches in another frame: each vector times a matrix (3, 3)."""
        return Wrenches(self.force.dot(matrix), self.moment.dot(matrix))

    def pressure(self, leg: int) -> complex:
        """Centre of pressure of a foot relative to its middle, m, x + i y; 0 without force."""
        x, y, _ = self.moment[leg].tolist()
        upward_n = float(self.force[leg, 2])
        return complex(-y, x) / upward_n if upward_n > 0.0 else 0j

    def about(self, arms: np.ndarray) -> np.ndarray:
        """Total moment (3,), N m, about a point, with arms (legs, 3), m, from that point to the feet."""
        return moment(arms, self.force) + np.add.reduce(self.moment)


def moment(arms: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Sum of the cross products of arms and forces, each (k, 3): (3,)."""
    products = arms.T @ forces
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = products.tolist()
    return np.array([yz - zy, zx - xz, xy - yx])


def sole_levers(robot: Robot, share: float) -> np.ndarray:
    """Largest moments of soles per upward force, about x and y, and about z per friction coefficient.

    The centre of pressure may leave the middle by a share of half the sole's mean width and length.
    About z, friction acts at the mean distance of the corners, times that share.

    Returns:
        (legs, 3) m.
    """
    levers = []
    for rotation, spheres in zip(
        robot.legs.tip_rotation(robot.default_pose), robot.legs.spheres, strict=True
    ):
        along, across, _ = np.abs(spheres.centre @ rotation.T).mean(axis=0)
        levers.append([across, along, np.hypot(along, across)])
    return share * np.array(levers)
