"""MuJoCo C and MJX agree: the same model under the same joint commands goes the same way."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from mujoco import mjx

from footfall.robots.actuator import JointCommand, Motor, joint_torque
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, training_model

DURATION_S = 0.2


def command(robot: Robot, tick: np.ndarray | jax.Array, timestep: float, xp) -> JointCommand:
    """Stand, while the legs follow a slow wave."""
    wave = 0.1 * xp.sin(2 * xp.pi * 2.0 * timestep * tick)
    offset = xp.asarray(np.tile((0.0, 1.0, -2.0), 4)) * wave
    zero = xp.zeros(12)
    return JointCommand(
        xp.asarray(robot.default_pose) + offset, zero, xp.asarray(robot.kp), xp.asarray(robot.kd), zero
    )


def rollout_in_c(robot: Robot, model: mujoco.MjModel, start: np.ndarray, steps: int) -> np.ndarray:
    positions, dofs = joint_addresses(model, robot)
    data = mujoco.MjData(model)
    data.qpos[:] = start
    visited = []
    for tick in range(steps):
        data.qfrc_applied[dofs] = joint_torque(
            command(robot, np.asarray(tick), model.opt.timestep, np),
            data.qpos[positions],
            data.qvel[dofs],
            robot.motor,
        )
        mujoco.mj_step(model, data)
        visited.append(data.qpos.copy())
    return np.array(visited)


def rollout_in_mjx(robot: Robot, model: mujoco.MjModel, start: np.ndarray, steps: int) -> np.ndarray:
    positions, dofs = (jnp.asarray(a) for a in joint_addresses(model, robot))
    on_device = mjx.put_model(model)
    motor = Motor(*(jnp.asarray(part) for part in robot.motor))

    def step(data: mjx.Data, tick: jax.Array) -> tuple[mjx.Data, jax.Array]:
        torque = joint_torque(
            command(robot, tick, model.opt.timestep, jnp), data.qpos[positions], data.qvel[dofs], motor
        )
        data = mjx.step(on_device, data.replace(qfrc_applied=jnp.zeros(model.nv).at[dofs].set(torque)))
        return data, data.qpos

    data = mjx.make_data(model).replace(qpos=jnp.asarray(start, jnp.float32))
    _, visited = jax.jit(lambda data: jax.lax.scan(step, data, jnp.arange(steps)))(data)
    return np.asarray(visited)


@pytest.mark.parametrize("timestep_s", [0.002, 0.005])
def test_mujoco_and_mjx_stay_together(go1: Robot, timestep_s: float) -> None:
    model = training_model(go1, timestep_s)
    start = np.zeros(model.nq)
    start[:7] = (0, 0, go1.description.standing_height_m, 1, 0, 0, 0)
    start[joint_addresses(model, go1)[0]] = go1.default_pose
    steps = round(DURATION_S / timestep_s)
    ours = rollout_in_c(go1, model, start, steps)
    theirs = rollout_in_mjx(go1, model, start, steps)
    joints = joint_addresses(model, go1)[0]
    assert np.ptp(ours[:, joints], axis=0).max() > 0.05  # it did move
    np.testing.assert_allclose(theirs[:, :3], ours[:, :3], atol=5e-4)
    np.testing.assert_allclose(theirs[:, 3:7], ours[:, 3:7], atol=1e-3)
    np.testing.assert_allclose(theirs[:, joints], ours[:, joints], atol=2e-3)
