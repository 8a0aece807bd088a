"""Pairs of legs that collide in training, of the shipped robots."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from posed import posed

from footfall.robots.description import Robot, load_robot
from footfall.robots.model import plant_model, training_model

JOINT_RAD = 0.1  # initial distance of episodes from the default pose
DECLARED = {
    "go1": {("FR", "FL"), ("RR", "RL")},
    "hexapod": {("LF", "LM"), ("LM", "LR"), ("RF", "RM"), ("RM", "RR")},
    "g1": {("left", "right")},
}


@pytest.fixture(params=DECLARED, scope="module")
def robot(request: pytest.FixtureRequest) -> Robot:
    return load_robot(request.param)


@pytest.fixture(scope="module")
def reduced(robot: Robot) -> mujoco.MjModel:
    return training_model(robot)


def touching(model: mujoco.MjModel, robot: Robot, pose: np.ndarray) -> list[tuple[str, str]]:
    """The geoms that touch in the air."""
    contacts = posed(model, robot, 5.0, pose).contact
    touching = contacts.geom[contacts.dist <= 0.0].tolist()
    return [(model.geom(one).name, model.geom(other).name) for one, other in touching]


def test_no_legs_touch_where_training_starts(robot: Robot, reduced: mujoco.MjModel) -> None:
    assert not touching(reduced, robot, robot.default_pose)
    spread = JOINT_RAD * np.random.default_rng(0).uniform(-1, 1, (300, len(robot.joint_names)))
    for offset in spread:
        assert not touching(reduced, robot, robot.default_pose + offset)


def crossed(go1: Robot, hip_rad: float, legs: tuple[int, int]) -> np.ndarray:
    """go1's default pose with two legs led inwards; joints are listed leg by leg, right before left."""
    pose = go1.default_pose.copy()
    pose[[3 * leg for leg in legs]] = hip_rad, -hip_rad
    return pose


@pytest.mark.parametrize(("legs", "names"), [((0, 1), ("FR", "FL")), ((2, 3), ("RR", "RL"))])
def test_legs_touch_once_at_shank_and_foot(go1: Robot, legs: tuple[int, int], names: tuple[str, str]) -> None:
    """Two legs start to touch at the distance of a shank's and a foot's radius, 12 mm and 23 mm."""
    model = training_model(go1)
    expected = {f"{name}_shank" for name in names}
    met = []
    for hip_rad in np.arange(0.3, 0.6, 0.002):
        pose = crossed(go1, hip_rad, legs)
        feet = (model.geom(f"{name}_foot").id for name in names)
        apart_m = mujoco.mj_geomDistance(model, posed(model, go1, 5.0, pose), *feet, 1.0, None)
        found = touching(model, go1, pose)
        assert [set(pair) for pair in found] in ([], [expected])
        met.append((apart_m + 2 * 0.023, bool(found)))
    first = next(distance for distance, touch in met if touch)
    assert first == pytest.approx(0.012 + 0.023, abs=1e-3)


def test_pairs_stay_on_the_plant_if_legs_collide_only_through_pairs(own_folder: Path) -> None:
    """The robot's shanks and feet touch only through pairs."""
    xml = own_folder / "robot.xml"
    text = xml.read_text().replace('size="0.012"', 'size="0.012" contype="0" conaffinity="0"')
    xml.write_text(
        text.replace('friction="0.8" density', 'friction="0.8" contype="0" conaffinity="0" density')
    )
    assert plant_model(load_robot(own_folder)).npair == 2
