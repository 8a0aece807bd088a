"""Indices of the base in positions and velocities, against MuJoCo's."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from go1_smoke import MODEL, ROBOT, SMOKE
from scipy.spatial.transform import Rotation

from footfall.domain_rand.noise import Noise
from footfall.envs.base import Base
from footfall.envs.locomotion import LocomotionEnv
from footfall.robots.description import load_robot
from footfall.robots.model import training_model

QUATERNION = Rotation.from_euler("xyz", [0.3, -0.4, 2.0]).as_quat()[[3, 0, 1, 2]]


def test_a_base_tilted_about_all_axes_moves_as_in_mujoco() -> None:
    data = mujoco.MjData(MODEL)
    data.qpos[:7] = [1.0, 2.0, 0.4, *QUATERNION]
    data.qvel[:6] = [0.7, -0.3, 0.5, 0.2, -0.6, 0.9]
    mujoco.mj_forward(MODEL, data)
    body, local = MODEL.body(ROBOT.description.base).id, np.zeros(6)
    mujoco.mj_objectVelocity(MODEL, data, mujoco.mjtObj.mjOBJ_XBODY, body, local, 1)
    base = Base(MODEL, ROBOT)
    qpos, qvel = jnp.asarray(data.qpos, jnp.float32), jnp.asarray(data.qvel, jnp.float32)
    np.testing.assert_allclose(base.angular_velocity(qvel), local[:3], atol=1e-6)
    np.testing.assert_allclose(base.linear_velocity(qpos, qvel), local[3:], atol=1e-6)
    np.testing.assert_allclose(base.gravity(qpos), -data.xmat[body].reshape(3, 3)[2], atol=1e-6)
    np.testing.assert_allclose(base.position(qpos), [1.0, 2.0, 0.4])


def test_a_base_behind_other_joints_is_found(tmp_path: Path) -> None:
    """A robot whose free joint is the second joint in the file; the first is the hinge of a flag."""
    folder = tmp_path / "flagged"
    shutil.copytree(ROBOT.folder, folder)
    path = folder / ROBOT.description.model
    flag = '<body name="flag" pos="5 5 1"><joint name="wind" axis="0 0 1"/><geom size=".1" mass="1"/></body>'
    path.write_text(re.sub(r"(<worldbody>)", rf"\1{flag}", path.read_text(), count=1))
    robot = load_robot(str(folder))
    env = LocomotionEnv(robot, replace(SMOKE, noise=Noise()))
    state, _ = jax.jit(env.reset)(jax.random.PRNGKey(1))
    data = mujoco.MjData(training_model(robot, env.timestep_s))
    assert data.qpos.shape == (20,)
    assert env.scene.base.position(state.qpos)[2] == pytest.approx(robot.description.standing_height_m)
    assert np.linalg.norm(env.scene.base.quaternion(state.qpos)) == pytest.approx(1.0)
    moved = np.asarray(env.scene.base.pushed(jnp.zeros(19), jnp.arange(1.0, 7.0)))
    np.testing.assert_array_equal(moved[:7], [0, 1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(env.scene.base.angular_velocity(jnp.asarray(moved)), [4, 5, 6])
