"""Where a robot can touch itself in training is where it can on the simulated robot."""

import mujoco
import numpy as np
import pytest

from footfall.robots.description import load_robot
from footfall.robots.model import joint_addresses, plant_model, training_model

DEEP_M = 0.01  # by which shapes may overlap before what stands for them touches


@pytest.mark.parametrize("name", ["go1", "g1"])
def test_deep_contacts_of_the_simulated_robot_are_seen(name: str) -> None:
    robot = load_robot(name)
    plant, trained = plant_model(robot), training_model(robot, contacts="whole_body")
    (plant_joints, _), (joints, _) = joint_addresses(plant, robot), joint_addresses(trained, robot)
    theirs, ours, rng = mujoco.MjData(plant), mujoco.MjData(trained), np.random.default_rng(0)
    touching = missed = invented = 0
    for _ in range(1000):
        pose = rng.uniform(*robot.soft_limits)
        for model, data, places in ((plant, theirs, plant_joints), (trained, ours, joints)):
            data.qpos[2], data.qpos[places] = 5.0, pose
            mujoco.mj_fwdPosition(model, data)
        deep = theirs.ncon > 0 and theirs.contact.dist.min() < -DEEP_M
        touching += deep
        missed += deep and not ours.ncon
        invented += ours.ncon > 0 and theirs.ncon == 0
    assert touching > 10
    assert missed <= 0.1 * touching
    assert invented <= 0.5 * touching


def test_without_them_only_the_listed_pairs_meet() -> None:
    assert training_model(load_robot("go1")).npair == 2
