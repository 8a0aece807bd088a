"""Self-contacts in training are those of the simulated robot."""

import mujoco
import numpy as np
import pytest

from footfall.robots.description import load_robot
from footfall.robots.model import joint_addresses, plant_model, training_model

DEEP_M = 0.01  # allowed overlap before training's simpler shapes touch
NEAR_M = 0.006  # allowed distance when training's simpler shapes touch


@pytest.mark.parametrize("name", ["go1", "g1"])
def test_deep_contacts_of_the_simulated_robot_are_seen(name: str) -> None:
    robot = load_robot(name)
    plant, trained = plant_model(robot), training_model(robot, contacts="whole_body")
    plant.geom_margin[:] = NEAR_M  # training's one geom for a shank and its foot is thicker than the shank
    (plant_joints, _), (joints, _) = joint_addresses(plant, robot), joint_addresses(trained, robot)
    on_plant, in_training, rng = mujoco.MjData(plant), mujoco.MjData(trained), np.random.default_rng(0)
    touching = missed = invented = 0
    for _ in range(1000):
        pose = rng.uniform(*robot.soft_limits)
        for model, data, addresses in ((plant, on_plant, plant_joints), (trained, in_training, joints)):
            data.qpos[2], data.qpos[addresses] = 5.0, pose
            mujoco.mj_fwdPosition(model, data)
        deep = on_plant.ncon > 0 and on_plant.contact.dist.min() < -DEEP_M
        touching += deep
        missed += deep and not in_training.ncon
        invented += in_training.ncon > 0 and on_plant.ncon == 0
    assert touching > 10
    assert missed <= 0.1 * touching
    assert invented <= 0.5 * touching


def test_original_shapes_collide_as_on_the_simulated_robot() -> None:
    """A simplified, thick shank cannot hook behind another leg, but a sphere foot on a thin shank can."""
    robot = load_robot("go1")
    model = training_model(robot, contacts="true_limbs")
    paired = {model.geom(g).name for g in np.concatenate([model.pair_geom1, model.pair_geom2])}
    assert paired >= {foot.geoms[0] for foot in robot.description.feet}
    assert not paired & {"FR_shank", "FL_shank", "RR_shank", "RL_shank"}


def test_the_long_edges_of_a_box_are_sharp() -> None:
    """A thigh jams under an edge of the trunk from which it would slide if that were round."""
    model = training_model(load_robot("go1"), contacts="whole_body")
    shapes = np.flatnonzero(model.geom_bodyid == 1)
    box = next(g for g in shapes if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX)
    half = model.geom_size[box, 1:]
    capsules = shapes[model.geom_type[shapes] == mujoco.mjtGeom.mjGEOM_CAPSULE]
    for sides in ([-1, -1], [-1, 1], [1, -1], [1, 1]):
        away = np.linalg.norm(model.geom_pos[capsules, 1:] - sides * half, axis=1)
        assert (away - model.geom_size[capsules, 0]).min() < 0.002
