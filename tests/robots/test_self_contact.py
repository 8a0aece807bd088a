"""Legs, the bodies that belong to them, and their contacts in training and on the simulated robot."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from posed import posed

from footfall import Robot, load_robot
from footfall.robots.leg_bodies import NO_LEG, leg_of_bodies
from footfall.robots.model import joint_addresses, plant_model, training_model

DEEP_M = 0.01  # allowed overlap before training's simpler shapes touch
NEAR_M = 0.006  # allowed distance when training's simpler shapes touch


def touching(model: mujoco.MjModel, robot: Robot, pose: np.ndarray) -> list[set[str]]:
    """The pairs of geoms that touch in the air."""
    contacts = posed(model, robot, 5.0, pose).contact
    return [{model.geom(geom).name for geom in pair} for pair in contacts.geom[contacts.dist <= 0.0].tolist()]


@pytest.mark.parametrize("name", ["go1", "hexapod", "g1"])
def test_no_legs_touch_where_training_starts(name: str) -> None:
    robot = load_robot(name)
    model, rng = training_model(robot), np.random.default_rng(0)
    for spread in (0.0, *300 * [0.1]):  # rad, initial distance of episodes from the default pose
        offset = spread * rng.uniform(-1, 1, len(robot.joint_names))
        assert not touching(model, robot, robot.default_pose + offset)


@pytest.mark.parametrize(("first", "names"), [(0, ("FR", "FL")), (2, ("RR", "RL"))])
def test_legs_touch_once_at_shank_and_foot(go1: Robot, first: int, names: tuple[str, str]) -> None:
    """Two legs led inwards touch at the distance of a shank's and a foot's radius, 12 mm and 23 mm."""
    model, pose, met = training_model(go1), go1.default_pose.copy(), []
    for hip_rad in np.arange(0.3, 0.6, 0.002):
        pose[[3 * first, 3 * first + 3]] = hip_rad, -hip_rad
        feet = (model.geom(f"{name}_foot").id for name in names)
        apart_m = mujoco.mj_geomDistance(model, posed(model, go1, 5.0, pose), *feet, 1.0, None)
        found = touching(model, go1, pose)
        assert found in ([], [{f"{name}_shank" for name in names}])
        met.append((apart_m + 2 * 0.023, bool(found)))
    assert next(distance for distance, touch in met if touch) == pytest.approx(0.012 + 0.023, abs=1e-3)


def test_pairs_stay_on_the_plant_if_legs_collide_only_through_pairs(own_folder: Path) -> None:
    """The robot's shanks and feet touch only through pairs."""
    text = (own_folder / "robot.xml").read_text()
    for geom in ('size="0.012"', 'friction="0.8" density'):
        text = text.replace(geom, f'contype="0" conaffinity="0" {geom}')
    (own_folder / "robot.xml").write_text(text)
    assert plant_model(load_robot(own_folder)).npair == 2


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


def test_original_shapes_collide_as_on_the_simulated_robot(go1: Robot) -> None:
    """A simplified, thick shank cannot hook behind another leg, but a sphere foot on a thin shank can."""
    model = training_model(go1, contacts="true_limbs")
    paired = {model.geom(g).name for g in np.concatenate([model.pair_geom1, model.pair_geom2])}
    assert paired >= {foot.geoms[0] for foot in go1.description.feet}
    assert not paired & {"FR_shank", "FL_shank", "RR_shank", "RL_shank"}


def test_the_long_edges_of_a_box_are_sharp(go1: Robot) -> None:
    """A thigh jams under an edge of the trunk from which it would slide if that were round."""
    model = training_model(go1, contacts="whole_body")
    shapes = np.flatnonzero(model.geom_bodyid == 1)
    box = next(g for g in shapes if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX)
    half = model.geom_size[box, 1:]
    capsules = shapes[model.geom_type[shapes] == mujoco.mjtGeom.mjGEOM_CAPSULE]
    for sides in ([-1, -1], [-1, 1], [1, -1], [1, 1]):
        away = np.linalg.norm(model.geom_pos[capsules, 1:] - sides * half, axis=1)
        assert (away - model.geom_size[capsules, 0]).min() < 0.002


def test_a_leg_consists_of_the_bodies_that_only_its_joints_move() -> None:
    # Both legs hang on a waist; the left leg ends in a foot that is fixed to its shank.
    model = mujoco.MjModel.from_xml_string("""
      <mujoco><worldbody><body name="base"><freejoint/><geom size="0.1"/>
        <body name="tail"><joint name="wag"/><geom size="0.02"/></body>
        <body name="waist"><joint name="twist"/><geom size="0.05"/>
          <body name="right"><joint name="right_hip"/><geom size="0.02"/></body>
          <body name="left"><joint name="left_hip"/><geom size="0.02"/>
            <body name="shank"><joint name="knee"/><geom size="0.02"/>
              <body name="foot"><geom size="0.02"/></body></body></body></body>
      </body></worldbody></mujoco>""")
    legs = leg_of_bodies(model, [("twist", "left_hip", "knee"), ("twist", "right_hip")])
    by_name = {model.body(body).name: leg for body, leg in enumerate(legs.tolist())}
    none = dict.fromkeys(("world", "base", "tail", "waist"), NO_LEG)
    assert by_name == none | {"right": 1, "left": 0, "shank": 0, "foot": 0}
    assert np.all(leg_of_bodies(model, []) == NO_LEG)
