"""The robot's feet: spheres, or soles that stand on several spheres, each with its phase in the gait."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from footfall.common.arrays import single
from footfall.envs.ground import height_above_ground
from footfall.policies.gaits import GaitPattern, planned_lift
from footfall.robots.description import Robot
from footfall.robots.feet import foot_geoms


class Feet:
    """Quantities of the feet, from the positions of their spheres in the physics.

    Results are (feet, ...) in the robot's order. Points are the spheres' centres, foot after foot.
    """

    def __init__(
        self, model: mujoco.MjModel, robot: Robot, timestep_s: float, gait: GaitPattern | None
    ) -> None:
        feet = foot_geoms(model, robot.description)
        self._radius = single(model.geom_size[np.concatenate(feet), 0])
        counts = [len(geoms) for geoms in feet]
        starts, max_count = np.cumsum([0, *counts[:-1]]), max(counts)
        # The points of each foot, (feet, max_count); a foot with fewer points repeats them.
        self._points_of_foot = np.array(
            [start + np.arange(max_count) % count for start, count in zip(starts, counts, strict=True)]
        )
        self._gait = gait
        self._timestep_s = timestep_s
        self.count, self.point_count = len(feet), sum(counts)

    def clearance(self, position: jax.Array, ground: jax.Array | float = 0.0) -> jax.Array:
        """Height of each foot's lowest point above the ground, m, (feet,).

        Args:
            position: position of the points, m, world, (points, 3).
            ground: height of the terrain below each point, over the world's z = 0, m, (points,).
        """
        return jnp.min((height_above_ground(position) - ground - self._radius)[self._points_of_foot], axis=1)

    def min_over_points(self, values: jax.Array) -> jax.Array:
        """Minimum of the values (points,) over each foot's points, (feet,)."""
        return jnp.min(values[self._points_of_foot], axis=1)

    def tilt(self, position: jax.Array, ground: jax.Array | float = 0.0) -> jax.Array:
        """Height of each foot's highest point above its lowest, m, (feet,); arguments as of `clearance`."""
        height = (height_above_ground(position) - ground - self._radius)[self._points_of_foot]
        return jnp.max(height, axis=1) - jnp.min(height, axis=1)

    def speed(self, positions: jax.Array) -> jax.Array:
        """Horizontal speed of each foot in the last physics step, m/s, from points (substeps, points, 3).

        It is the speed of the foot's fastest point: a sole that turns on the spot slips.
        """
        velocity = (positions[-1] - positions[-2]) / self._timestep_s
        speed_sq = jnp.sum(velocity[:, :2] ** 2, axis=-1)
        return jnp.sqrt(jnp.max(speed_sq[self._points_of_foot], axis=1))

    def centres(self, position: jax.Array) -> jax.Array:
        """Middle of each foot's points, m, (feet, 3), from points (points, 3)."""
        return jnp.mean(position[self._points_of_foot], axis=1)

    def crowding(self, position: jax.Array, min_distance_m: float) -> jax.Array:
        """Shortfall of the distance between two feet, squared and summed over pairs, m^2.

        Args:
            position: position of the points (points, 3), m. A foot's position is the mean of its points.
            min_distance_m: horizontal distance beyond which a pair does not count.
        """
        centre = self.centres(position)[:, :2]
        first, second = np.triu_indices(self.count, k=1)
        distance_sq = jnp.sum((centre[first] - centre[second]) ** 2, axis=-1)
        return jnp.sum(jnp.maximum(min_distance_m - jnp.sqrt(distance_sq), 0.0) ** 2)

    def planned_swing(self, phase: jax.Array, moving: jax.Array) -> jax.Array:
        """Planned swing of each foot: 0 in stance, rising to 1 at mid-swing; 0 without a gait.

        Args:
            phase: phase of the gait clock, in cycles, shape (1,).
            moving: 1.0 if the command asks to move, else 0.0, and all feet stand.
        """
        if self._gait is None:
            return jnp.zeros(self.count)
        offsets = jnp.asarray(self._gait.phase, dtype=jnp.float32)
        return planned_lift(phase, offsets, self._gait.duty) * moving
