"""Location of the base in a model's `qpos` and `qvel`.

MuJoCo gives a free joint seven positions (position and quaternion in the world) and six velocities (linear in
the world, angular in the body). It need not be the first joint of a model.
"""

from typing import Any

import jax
import mujoco

from footfall.common.rotations import projected_gravity, rotate_to_body
from footfall.robots.description import Robot

Array = Any  # a NumPy or a JAX array


class Base:
    """Reads and changes the base's part of `qpos` (nq,) and `qvel` (nv,)."""

    def __init__(self, model: mujoco.MjModel, robot: Robot) -> None:
        joint = model.body(robot.description.base).jntadr[0]
        qpos_start, qvel_start = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
        self._position = slice(qpos_start, qpos_start + 3)
        self._quaternion = slice(qpos_start + 3, qpos_start + 7)
        self._linear = slice(qvel_start, qvel_start + 3)
        self._angular = slice(qvel_start + 3, qvel_start + 6)
        self._velocity = slice(qvel_start, qvel_start + 6)

    def position(self, qpos: Array) -> Array:
        """Position of the base in the world, m, (3,)."""
        return qpos[self._position]

    def quaternion(self, qpos: jax.Array) -> jax.Array:
        """Body to world, w x y z."""
        return qpos[self._quaternion]

    def gravity(self, qpos: jax.Array) -> jax.Array:
        """Direction of gravity in the body frame, a unit vector (3,)."""
        return projected_gravity(self.quaternion(qpos))

    def linear_velocity(self, qpos: jax.Array, qvel: jax.Array) -> jax.Array:
        """Velocity of the base in the body frame, m/s, (3,)."""
        return rotate_to_body(self.quaternion(qpos), qvel[self._linear])

    def angular_velocity(self, qvel: jax.Array) -> jax.Array:
        """Angular velocity in the body frame, rad/s, (3,)."""
        return qvel[self._angular]

    def turned(self, qpos: jax.Array, quaternion: jax.Array) -> jax.Array:
        """Positions with another attitude of the base."""
        return qpos.at[self._quaternion].set(quaternion)

    def shifted(self, qpos: jax.Array, offset: jax.Array) -> jax.Array:
        """Positions with the base moved by an offset (3,), m, in the world."""
        return qpos.at[self._position].add(offset)

    def at_height(self, qpos: jax.Array, height_m: jax.Array) -> jax.Array:
        """Positions with the base at another height above the world's origin."""
        return qpos.at[self._position.stop - 1].set(height_m)

    def moving(self, qvel: jax.Array, linear: jax.Array, yaw_rate: jax.Array) -> jax.Array:
        """Velocities with the base's horizontal velocity (2,) and its yaw rate set."""
        horizontal = slice(self._linear.start, self._linear.start + 2)
        return qvel.at[horizontal].set(linear).at[self._angular.stop - 1].set(yaw_rate)

    def pushed(self, qvel: jax.Array, change: jax.Array) -> jax.Array:
        """Velocities after a change (6,) of the base's velocity: linear in the world, angular in the body."""
        return qvel.at[self._velocity].add(change)
