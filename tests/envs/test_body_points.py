"""Points on trunk and limbs lie on MuJoCo's shapes of the robot, and terms see them in the ground."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from footfall.envs.body_points import BodyPoints
from footfall.envs.feet import Feet
from footfall.envs.terms.data import Scene, StepData, example_data
from footfall.envs.terms.rewards import collision
from footfall.envs.terms.terminations import base_contact
from footfall.robots.description import Robot, load_robot
from footfall.robots.link_tree import load_model
from footfall.robots.model import training_model

STEP_S = 1 / 200


def to_shape(model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) from the core of a shape: a box, or the line or point inside a round one."""
    own, size = (
        np.abs((point - data.geom_xpos[geom]) @ data.geom_xmat[geom].reshape(3, 3)),
        model.geom_size[geom],
    )
    kind = mujoco.mjtGeom(model.geom_type[geom]).name
    core = {
        "mjGEOM_SPHERE": np.zeros(3),
        "mjGEOM_CAPSULE": np.array([0.0, 0.0, size[1]]),
        "mjGEOM_BOX": size,
    }[kind]
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
    shapes = [
        geom
        for geom in range(model.ngeom)
        if (model.geom_contype[geom] or model.geom_conaffinity[geom]) and model.geom(geom).name not in feet
    ]
    distances = np.array([to_shape(model, data, geom, positions) for geom in shapes])
    assert distances.min(axis=0).max() < 1e-5
    assert (distances < 1e-5).any(axis=1).all()  # no shape is without a point
    base = model.body(robot.description.base).id
    on_base = distances[model.geom_bodyid[shapes] == base].min(axis=0) < 1e-5
    assert points.on_base.any()
    assert np.all(on_base[points.on_base])


@pytest.fixture(scope="module")
def standing(go1: Robot) -> StepData:
    model = training_model(go1, STEP_S)
    return example_data(Scene(model, go1, Feet(model, go1, STEP_S, None), 0.02))


def sunk_to(data: StepData, bottom_m: float) -> StepData:
    """The data with the trunk's lower face, 0.05 m below its middle, at this height."""
    return data._replace(qpos=data.scene.base.at_height(data.qpos, jnp.float32(bottom_m + 0.05)))


def test_a_trunk_in_the_ground_ends_the_episode_and_standing_does_not(standing: StepData) -> None:
    lying = sunk_to(standing, -0.02)
    depth_m = lying.depth[np.flatnonzero(standing.scene.body.on_base)].max()
    assert (float(collision(standing)), float(depth_m)) == (0.0, pytest.approx(0.02, abs=1e-6))
    assert base_contact(lying)
    assert not base_contact(lying, depth_m=0.03)
    for clear in (standing, sunk_to(standing, 0.01)):
        assert not base_contact(clear)


@pytest.mark.parametrize("edge_m", np.arange(-0.1, 0.08, 0.03))
def test_an_edge_of_a_step_under_a_tilted_trunk_ends_the_episode(standing: StepData, edge_m: float) -> None:
    pitch = np.radians(-25.0)  # nose up
    turned = jnp.asarray(standing.qpos).at[3:7].set([np.cos(pitch / 2), 0.0, np.sin(pitch / 2), 0.0])
    tilted = standing._replace(qpos=standing.scene.base.at_height(turned, jnp.float32(0.0)))
    lower_face = -0.05 / np.cos(pitch) - edge_m * np.tan(pitch)  # height above x = edge_m
    for height_m, touched in ((lower_face - 0.02, False), (lower_face + 0.035, True)):
        edge = tilted._replace(ground=lambda p, h=height_m: jnp.where(p[..., 0] >= edge_m, h, -1.0))
        assert base_contact(edge) == touched
