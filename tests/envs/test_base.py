"""Base, feet and points on the body: where they are and how they move, against MuJoCo's."""

import re
import shutil
from pathlib import Path

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from go1_smoke import MODEL, ROBOT, SCENE, SMOKE
from scipy.spatial.transform import Rotation

from footfall.envs.base import Base
from footfall.envs.body_points import BodyPoints
from footfall.envs.feet import Feet
from footfall.envs.ground import in_contact
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.terms.data import StepData, example_data
from footfall.envs.terms.rewards import collision
from footfall.envs.terms.terminations import base_contact
from footfall.robots.description import load_robot
from footfall.robots.link_tree import load_model


def test_a_base_tilted_about_all_axes_moves_as_in_mujoco() -> None:
    data, body, expected = mujoco.MjData(MODEL), MODEL.body(ROBOT.description.base).id, np.zeros(6)
    data.qpos[:3] = [1.0, 2.0, 0.4]
    data.qpos[3:7] = Rotation.from_euler("xyz", [0.3, -0.4, 2.0]).as_quat(scalar_first=True)
    data.qvel[:6] = [0.7, -0.3, 0.5, 0.2, -0.6, 0.9]
    mujoco.mj_forward(MODEL, data)
    mujoco.mj_objectVelocity(MODEL, data, mujoco.mjtObj.mjOBJ_XBODY, body, expected, 1)
    base = Base(MODEL, ROBOT)
    qpos, qvel = jnp.asarray(data.qpos, jnp.float32), jnp.asarray(data.qvel, jnp.float32)
    np.testing.assert_allclose(base.angular_velocity(qvel), expected[:3], atol=1e-6)
    np.testing.assert_allclose(base.linear_velocity(qpos, qvel), expected[3:], atol=1e-6)
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


def distance_to_core(model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from the core of a shape: a box, or the line or point inside a round one."""
    size = model.geom_size[geom]
    cores = {"SPHERE": np.zeros(3), "CAPSULE": np.array([0.0, 0.0, size[1]]), "BOX": size}
    core = cores[mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_")]
    own = np.abs((point - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3))
    return np.linalg.norm(np.maximum(own - core, 0.0), axis=1)


@pytest.mark.parametrize("name", ["go1", "hexapod", "g1"])
def test_points_are_on_the_shapes_that_can_collide_and_move_with_the_joints(name: str) -> None:
    robot = load_robot(name)
    points, model = BodyPoints(robot), load_model(robot)
    data = mujoco.MjData(model)
    data.qpos += np.random.default_rng(3).normal(0.0, 0.4, model.nq)
    mujoco.mj_normalizeQuat(model, data.qpos)
    mujoco.mj_kinematics(model, data)
    positions = np.asarray(jax.jit(points.points)(data.qpos.astype(np.float32)))
    feet = {geom for foot in robot.description.feet for geom in foot.geoms}
    collides = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    shapes = [geom for geom in collides if model.geom(geom).name not in feet]
    distances = np.array([distance_to_core(model, data, geom, positions) for geom in shapes])
    assert distances.min(axis=0).max() < 1e-5
    assert (distances < 1e-5).any(axis=1).all()  # no shape is without a point
    base = model.body(robot.description.base).id
    on_base = distances[model.geom_bodyid[shapes] == base].min(axis=0) < 1e-5
    assert points.on_base.any()
    assert np.all(on_base[points.on_base])


STANDING = example_data(SCENE)


def sunk_to(bottom_m: float) -> StepData:
    """The trunk's lower face, 0.05 m below its middle, is at this height."""
    return STANDING._replace(qpos=SCENE.base.at_height(STANDING.qpos, jnp.float32(bottom_m + 0.05)))


def test_a_trunk_in_the_ground_ends_the_episode_and_standing_does_not() -> None:
    lying = sunk_to(-0.02)
    depth_m = lying.depth[np.flatnonzero(SCENE.body.on_base)].max()
    assert (float(collision(STANDING)), float(depth_m)) == (0.0, pytest.approx(0.02, abs=1e-6))
    assert base_contact(lying)
    assert not base_contact(lying, depth_m=0.03)
    assert not any(map(base_contact, (STANDING, sunk_to(0.01))))


@pytest.mark.parametrize("edge_m", np.arange(-0.1, 0.08, 0.03))
def test_an_edge_of_a_step_under_a_tilted_trunk_ends_the_episode(edge_m: float) -> None:
    pitch = np.radians(-25.0)  # nose up
    turned = jnp.asarray(STANDING.qpos).at[3:7].set([np.cos(pitch / 2), 0.0, np.sin(pitch / 2), 0.0])
    tilted = STANDING._replace(qpos=SCENE.base.at_height(turned, jnp.float32(0.0)))
    lower_face = -0.05 / np.cos(pitch) - edge_m * np.tan(pitch)  # height above x = edge_m
    for height_m, touched in ((lower_face - 0.02, False), (lower_face + 0.035, True)):
        edge = tilted._replace(ground=lambda p, h=height_m: jnp.where(p[..., 0] >= edge_m, h, -1.0))
        assert base_contact(edge) == touched
