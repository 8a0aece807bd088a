"""The robot's feet: balls at the ends of its legs, each with its place in the gait."""

import jax
import jax.numpy as jnp
import mujoco

from footfall.envs.ground import height_above_ground
from footfall.policies.gaits import GaitPattern, planned_lift
from footfall.robots.description import Robot


class Feet:
    """What the feet do, from where the physics saw their centres; (feet, ...) in the robot's order."""

    def __init__(
        self, model: mujoco.MjModel, robot: Robot, timestep_s: float, gait: GaitPattern | None
    ) -> None:
        geoms = [model.geom(foot.geom).id for foot in robot.description.feet]
        self._radius = jnp.asarray(model.geom_size[geoms, 0], dtype=jnp.float32)
        self._gait = gait
        self._timestep_s = timestep_s
        self.count = len(geoms)

    def clearance(self, position: jax.Array) -> jax.Array:
        """Height of the lowest point above the ground, m, of centres (feet, 3)."""
        return height_above_ground(position) - self._radius

    def speed(self, positions: jax.Array) -> jax.Array:
        """Horizontal speed in the last physics step, m/s, of centres (substeps, feet, 3)."""
        velocity = (positions[-1] - positions[-2]) / self._timestep_s
        return jnp.sqrt(jnp.sum(velocity[:, :2] ** 2, axis=-1))

    def planned_swing(self, phase: jax.Array, moving: jax.Array) -> jax.Array:
        """What the gait plans: 0 in stance, rising to 1 at mid-swing; 0 where there is no gait.

        Args:
            phase: of the gait clock, in cycles, shape (1,).
            moving: 1.0 if the command asks to move, else 0.0, and all feet stand.
        """
        if self._gait is None:
            return jnp.zeros(self.count)
        offsets = jnp.asarray(self._gait.phase, dtype=jnp.float32)
        return planned_lift(phase, offsets, self._gait.duty) * moving
