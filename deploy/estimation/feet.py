"""Contact points of feet: below the centre of a sphere, at the lowest corners of a sole."""

import numpy as np

from footfall.robots.kinematics import Legs


class ContactPoints:
    """Point of each foot that stands still while the foot rolls or tips.

    For a sphere it is the lowest point. For a sole it is the mean of its corners' lowest points, weighted
    by exp(-height / level): all corners of a flat sole, only the edge of a tipping sole.
    """

    def __init__(self, legs: Legs, level_m: float) -> None:
        self._legs, self._level = legs, level_m
        self.spherical = all(  # whether each foot is one sphere around its tip
            len(spheres.radius) == 1 and not spheres.centre.any() for spheres in legs.spheres
        )
        self._radius = np.array([spheres.radius[:1] for spheres in legs.spheres])  # if all feet are spheres
        max_count = max(len(spheres.radius) for spheres in legs.spheres)
        # x, y, z, radius and 1 of each sphere: weighted sums give the mean. Padding has infinite height.
        self._spheres = np.zeros((legs.count, max_count, 5))
        self._height_offset = np.full((legs.count, max_count), np.inf)
        for leg, (position, radius) in enumerate(legs.spheres):
            own = slice(len(radius))
            self._spheres[leg, own] = np.column_stack([position, radius, np.ones_like(radius)])
            self._height_offset[leg, own] = -radius

    def arms(self, joint_position: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Vectors from each limb's tip to its contact point, (legs, 3) m, base frame.

        Args:
            joint_position: (n,) rad.
            up: (3,) vertical, base frame.
        """
        if self.spherical:
            return self._radius * -up
        rotation = self._legs.tip_rotation(joint_position)
        height = (self._spheres[:, :, :3] @ (up @ rotation)[:, :, None])[:, :, 0] + self._height_offset
        weight = np.exp((height.min(axis=1, keepdims=True) - height) / self._level)
        sums = (weight[:, None] @ self._spheres)[:, 0]
        mean = sums[:, :4] / sums[:, 4:]
        return (rotation @ mean[:, :3, None])[:, :, 0] - mean[:, 3:] * up
