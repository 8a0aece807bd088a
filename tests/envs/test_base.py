"""Indices of the base, and motion and contact of the feet, against MuJoCo's."""

import re
import shutil
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from go1_smoke import MODEL, ROBOT, SMOKE
from scipy.spatial.transform import Rotation

from footfall.envs.base import Base
from footfall.envs.feet import Feet
from footfall.envs.ground import in_contact
from footfall.envs.locomotion import LocomotionEnv
from footfall.robots.description import load_robot


def test_a_base_tilted_about_all_axes_moves_as_in_mujoco() -> None:
    data, body, local = mujoco.MjData(MODEL), MODEL.body(ROBOT.description.base).id, np.zeros(6)
    data.qpos[:3] = [1.0, 2.0, 0.4]
    data.qpos[3:7] = Rotation.from_euler("xyz", [0.3, -0.4, 2.0]).as_quat(scalar_first=True)
    data.qvel[:6] = [0.7, -0.3, 0.5, 0.2, -0.6, 0.9]
    mujoco.mj_forward(MODEL, data)
    mujoco.mj_objectVelocity(MODEL, data, mujoco.mjtObj.mjOBJ_XBODY, body, local, 1)
    base = Base(MODEL, ROBOT)
    qpos, qvel = jnp.asarray(data.qpos, jnp.float32), jnp.asarray(data.qvel, jnp.float32)
    np.testing.assert_allclose(base.angular_velocity(qvel), local[:3], atol=1e-6)
    np.testing.assert_allclose(base.linear_velocity(qpos, qvel), local[3:], atol=1e-6)
    np.testing.assert_allclose(base.gravity(qpos), -data.xmat[body].reshape(3, 3)[2], atol=1e-6)
    np.testing.assert_allclose(base.position(qpos), [1.0, 2.0, 0.4])


def test_a_base_behind_other_joints_is_found(tmp_path: Path) -> None:
    """A robot whose free joint is the second joint in the file; the first is the hinge of a flag."""
    folder = Path(shutil.copytree(ROBOT.folder, tmp_path / "flagged"))
    path = folder / ROBOT.description.model
    flag = '<body name="flag" pos="5 5 1"><joint name="wind" axis="0 0 1"/><geom size=".1" mass="1"/></body>'
    path.write_text(re.sub(r"(<worldbody>)", rf"\1{flag}", path.read_text(), count=1))
    env = LocomotionEnv(load_robot(str(folder)), SMOKE)
    base, (state, _) = env.scene.base, jax.jit(env.reset)(jax.random.PRNGKey(1))
    assert state.qpos.shape == (20,)
    assert base.position(state.qpos)[2] == pytest.approx(ROBOT.description.standing_height_m)
    assert np.linalg.norm(base.quaternion(state.qpos)) == pytest.approx(1.0)
    moved = base.pushed(jnp.zeros(19), jnp.arange(1.0, 7.0))
    np.testing.assert_array_equal(moved[:7], [0, 1, 2, 3, 4, 5, 6])
    np.testing.assert_array_equal(base.angular_velocity(moved), [4, 5, 6])


def test_a_standing_robot_touches_the_ground_with_all_feet() -> None:
    data = mujoco.MjData(MODEL)
    data.qpos[:] = [0, 0, ROBOT.description.standing_height_m, 1, 0, 0, 0, *ROBOT.default_pose]
    mujoco.mj_forward(MODEL, data)
    feet = np.array([data.geom(foot.geoms[0]).xpos for foot in ROBOT.description.feet])
    above = feet[:, 2] - [MODEL.geom(foot.geoms[0]).size[0] for foot in ROBOT.description.feet]
    assert np.abs(above).max() < 0.005  # so standing_height_m is right
    lifted = feet + np.outer([0.0, 0.001, 0.003, 0.05] - above, [0, 0, 1])
    clearance = Feet(MODEL, ROBOT, SMOKE.timestep_s, None).clearance(jnp.asarray(lifted, jnp.float32))
    np.testing.assert_allclose(clearance, [0.0, 0.001, 0.003, 0.05], atol=1e-6)
    np.testing.assert_array_equal(in_contact(clearance), [1.0, 1.0, 0.0, 0.0])


def test_a_foots_speed_is_horizontal_and_of_the_last_physics_step() -> None:
    positions = np.zeros((3, 4, 3))
    positions[0] = 7.0
    positions[2] = [[0.003, 0.004, 0.5], [0, 0, 0], [-0.01, 0, 0], [0, 0.02, 0]]
    speed = Feet(MODEL, ROBOT, timestep_s=0.005, gait=None).speed(jnp.asarray(positions))
    np.testing.assert_allclose(speed, [1.0, 0.0, 2.0, 4.0], rtol=1e-5)
