"""The state in which an episode begins: near the default pose, on its feet, at any heading."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from footfall.common.rotations import multiply, normalised
from footfall.envs.base import Base
from footfall.envs.config import InitialState
from footfall.envs.ground import ground_height
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses


class Start:
    """Draws the state of an episode's beginning."""

    def __init__(self, model: mujoco.MjModel, robot: Robot, config: InitialState) -> None:
        positions, dofs = joint_addresses(model, robot)
        self._positions, self._dofs = jnp.asarray(positions), jnp.asarray(dofs)
        self._base, self._config = Base(model, robot), config
        self._dof_count, self._joints = model.nv, len(positions)
        qpos = np.array(model.qpos0, dtype=np.float32)
        qpos[positions] = robot.default_pose
        place = self._base.position(qpos)
        place[2] = ground_height(place) + robot.description.standing_height_m
        self._standing = qpos
        self.numbers = 6 + 1 + 2 * self._joints  # that `draw` needs

    def draw(self, u: jax.Array) -> tuple[jax.Array, jax.Array]:
        """`qpos` (nq,) and `qvel` (nv,) from uniform numbers u in [0, 1), shape (numbers,)."""
        start, n = self._config, self._joints
        u = 2 * u - 1
        yaw = jnp.pi * u[0]
        tilt = start.tilt_rad * u[1:3]
        quaternion = multiply(
            jnp.array([jnp.cos(yaw / 2), 0.0, 0.0, jnp.sin(yaw / 2)]),
            normalised(jnp.array([1.0, tilt[0] / 2, tilt[1] / 2, 0.0])),
        )
        # Joints differ, and XLA is told so: what might add twice would be added one by one on a GPU.
        qpos = self._base.turned(jnp.asarray(self._standing), quaternion)
        qpos = qpos.at[self._positions].add(start.joint_rad * u[7 : 7 + n], unique_indices=True)
        qvel = jnp.zeros(self._dof_count)
        qvel = self._base.moving(qvel, start.velocity_m_s * u[3:5], start.yaw_rate_rad_s * u[5])
        return qpos, qvel.at[self._dofs].set(start.joint_velocity_rad_s * u[7 + n :], unique_indices=True)
