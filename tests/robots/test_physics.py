"""MuJoCo C and MJX agree: the same model under the same joint commands goes the same way."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx

from footfall.robots.actuator import JointCommand, joint_torque
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, training_model

STEPS = 40

Rollout = Callable[[mjx.Model, mjx.Data], jax.Array]


def command(robot: Robot, time_s: np.ndarray | jax.Array, xp) -> JointCommand:
    """Stand, while the legs follow a wave."""
    wave = 0.1 * xp.sin(2 * xp.pi * 2.0 * time_s)
    offset = xp.asarray(np.tile((0.0, 1.0, -2.0), 4)) * wave
    zero = xp.zeros(12)
    return JointCommand(
        xp.asarray(robot.default_pose) + offset, zero, xp.asarray(robot.kp), xp.asarray(robot.kd), zero
    )


def rollout_in_c(robot: Robot, model: mujoco.MjModel, start: np.ndarray) -> np.ndarray:
    positions, dofs = joint_addresses(model, robot)
    data = mujoco.MjData(model)
    data.qpos[:] = start
    visited = []
    for tick in range(STEPS):
        data.qfrc_applied[dofs] = joint_torque(
            command(robot, np.asarray(model.opt.timestep * tick), np),
            data.qpos[positions],
            data.qvel[dofs],
            robot.motor,
        )
        mujoco.mj_step(model, data)
        visited.append(data.qpos.copy())
    return np.array(visited)


@pytest.fixture(scope="module")
def rollout_in_mjx(go1: Robot) -> Rollout:
    """Compiled once for all steps' lengths: the model is an argument."""
    positions, dofs = (jnp.asarray(a) for a in joint_addresses(training_model(go1), go1))
    motor = jax.tree.map(jnp.asarray, go1.motor)

    @jax.jit
    def rollout(model: mjx.Model, data: mjx.Data) -> jax.Array:
        def step(data: mjx.Data, tick: jax.Array) -> tuple[mjx.Data, jax.Array]:
            asked = command(go1, model.opt.timestep * tick, jnp)
            torque = joint_torque(asked, data.qpos[positions], data.qvel[dofs], motor)
            applied = jnp.zeros_like(data.qvel).at[dofs].set(torque)
            data = mjx.step(model, data.replace(qfrc_applied=applied))
            return data, data.qpos

        return jax.lax.scan(step, data, jnp.arange(STEPS))[1]

    return rollout


@pytest.mark.parametrize("timestep_s", [0.002, 0.005])
def test_mujoco_and_mjx_stay_together(go1: Robot, rollout_in_mjx: Rollout, timestep_s: float) -> None:
    model = training_model(go1, timestep_s)
    start = np.zeros(model.nq)
    start[:7] = (0, 0, go1.description.standing_height_m, 1, 0, 0, 0)
    start[joint_addresses(model, go1)[0]] = go1.default_pose
    ours = rollout_in_c(go1, model, start)
    begun = mjx.make_data(model).replace(qpos=jnp.asarray(start, jnp.float32))
    theirs = np.asarray(rollout_in_mjx(mjx.put_model(model), begun))
    joints = joint_addresses(model, go1)[0]
    assert np.ptp(ours[:, joints], axis=0).max() > 0.05  # it did move
    np.testing.assert_allclose(theirs[:, :3], ours[:, :3], atol=5e-4)
    np.testing.assert_allclose(theirs[:, 3:7], ours[:, 3:7], atol=1e-3)
    np.testing.assert_allclose(theirs[:, joints], ours[:, joints], atol=2e-3)
