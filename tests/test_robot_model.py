"""The models derived from the one MJCF: what training leaves out, what the plant keeps."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import ground_friction, joint_addresses, plant_model, training_model


def standing(model: mujoco.MjModel, robot: Robot) -> mujoco.MjData:
    """The default pose, the feet a millimetre in the ground."""
    data = mujoco.MjData(model)
    data.qpos[:7] = (0, 0, robot.description.standing_height_m - 0.001, 1, 0, 0, 0)
    data.qpos[joint_addresses(model, robot)[0]] = robot.default_pose
    mujoco.mj_forward(model, data)
    return data


def constraint_rows(data: mujoco.MjData, kind: mujoco.mjtConstraint) -> int:
    return int(np.sum(data.efc_type == kind))


@pytest.fixture(scope="module")
def lean(go1: Robot) -> mujoco.MjModel:
    return training_model(go1)


def test_standing_costs_sixteen_constraint_rows(go1: Robot, lean: mujoco.MjModel) -> None:
    data = standing(lean, go1)
    assert data.ncon == 4
    assert data.nefc == 16  # four feet, four edges of a friction pyramid each
    assert constraint_rows(data, mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL) == 16


def test_training_has_no_rows_but_contact_even_past_the_limits(go1: Robot, lean: mujoco.MjModel) -> None:
    data = standing(lean, go1)
    data.qpos[2] = 1.0
    data.qpos[joint_addresses(lean, go1)[0]] = go1.upper_rad + 0.2
    data.qvel[:] = 1.0
    mujoco.mj_forward(lean, data)
    assert data.nefc == 0


def test_plant_holds_the_joints_at_their_limits(go1: Robot) -> None:
    model = plant_model(go1)
    data = standing(model, go1)
    data.qpos[2] = 1.0
    data.qpos[joint_addresses(model, go1)[0]] = go1.upper_rad + 0.01
    mujoco.mj_forward(model, data)
    assert constraint_rows(data, mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT) == 12


def test_friction_is_left_to_the_joint_law(go1: Robot, lean: mujoco.MjModel) -> None:
    for model in (lean, plant_model(go1)):
        assert not model.dof_frictionloss.any()
        assert not model.dof_damping.any()
    assert go1.motor.friction.all()


def test_training_model_has_the_plants_body(go1: Robot, lean: mujoco.MjModel) -> None:
    plant = plant_model(go1)
    assert lean.nbody == plant.nbody
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat", "body_pos", "dof_armature"):
        np.testing.assert_allclose(getattr(lean, field), getattr(plant, field), rtol=1e-12, atol=1e-15)


def test_bodies_keep_the_inertia_that_left_out_geoms_give_them(own_folder: Path) -> None:
    xml = own_folder / "robot.xml"
    text = re.sub(r"<inertial [^>]*/>", "", xml.read_text())
    xml.write_text(
        text.replace('group="3" condim="3" friction="0.6" density="0"', 'group="3" density="2000"')
    )
    xml.write_text(xml.read_text().replace('material="dark"', 'material="dark" density="500"'))
    robot = load_robot(own_folder)
    trained, plant = training_model(robot), plant_model(robot)
    assert np.abs(plant.body_ipos[1:]).max() > 0.01
    for field in ("body_mass", "body_inertia", "body_ipos", "body_iquat"):
        np.testing.assert_allclose(getattr(trained, field), getattr(plant, field), rtol=1e-12, atol=1e-15)


def test_training_model_is_lean(go1: Robot, lean: mujoco.MjModel) -> None:
    assert lean.ngeom == len(go1.description.feet) + 1
    assert lean.nu == lean.nsensor == lean.nkey == 0


def test_feet_touch_the_floor_but_not_each_other(go1: Robot, lean: mujoco.MjModel) -> None:
    data = standing(lean, go1)
    floor = lean.geom("floor").id
    assert all(floor in pair for pair in data.contact.geom)
    data.qpos[2] = 1.0
    data.qpos[joint_addresses(lean, go1)[0]] = go1.default_pose * np.tile((4.5, 1.0, 1.0), 4)  # inwards
    mujoco.mj_forward(lean, data)
    right, left = (data.geom(name).xpos for name in ("FR_foot", "FL_foot"))
    assert np.linalg.norm(right - left) < 2 * 0.023  # they overlap
    assert data.ncon == 0


@pytest.mark.parametrize("also", ["", 'condim="1"', 'condim="6"', 'solmix="0"'])
@pytest.mark.parametrize("priority", [0, 1])
def test_feet_meet_the_training_floor_as_they_would_the_plants(
    own_folder: Path, priority: int, also: str
) -> None:
    robot = load_robot(own_folder)
    text = robot.xml_path.read_text()
    foot = re.search('<geom [^>]*priority="1"[^>]*/>', text)
    assert foot is not None
    other = re.sub(' condim="[^"]*"', "", foot[0]) if "condim" in also else foot[0]
    other = re.sub('friction="[^"]*"', f'friction="0.3 0.01 0.001" solref="0.03 0.9" {also}', other)
    robot.xml_path.write_text(text.replace(foot[0], other.replace('priority="1"', f'priority="{priority}"')))
    trained, plant = (standing(model, robot).contact for model in (training_model(robot), plant_model(robot)))
    for field in ("friction", "solref", "solimp", "dim"):
        np.testing.assert_array_equal(getattr(trained, field), getattr(plant, field)[:4], field)


@pytest.mark.parametrize(
    ("foot", "expected"),
    [('priority="1" friction="0.3"', 0.3), ('friction="0.3"', 0.8), ('friction="0.9"', 0.9)],
)
def test_nominal_friction_is_that_of_the_contacts(own_folder: Path, foot: str, expected: float) -> None:
    """Of the floor's 0.8 and the foot's, MuJoCo takes the larger, or that of the foot with priority."""
    xml = own_folder / "robot.xml"
    text = re.sub(r'priority="1"\s+friction="0.8"', foot, xml.read_text())
    assert foot in text
    xml.write_text(text)
    robot = load_robot(own_folder)
    model = training_model(robot)
    np.testing.assert_allclose(ground_friction(model, robot), expected)
    np.testing.assert_allclose(standing(model, robot).contact.friction[:, 0], expected)


def test_plant_falls_onto_its_trunk(go1: Robot) -> None:
    model = plant_model(go1)
    data = standing(model, go1)
    data.qpos[2] = 0.04
    data.qpos[joint_addresses(model, go1)[0]] = np.tile((0.0, 1.5, -2.7), 4)
    mujoco.mj_forward(model, data)
    trunk = model.body("trunk").id
    touching = model.geom_bodyid[data.contact.geom].ravel()
    assert trunk in touching


BODY = '<body name="base" pos="0 0 1">{base}<geom size="0.1"/>{legs}</body>'
LEG = '<body pos="{x} 0 0"><joint name="{name}" type="{type}" range="-1 1"/><geom size="0.02"/></body>'


def write_plant(path: Path, robot: Robot, base: str = "<freejoint/>", **changes: str) -> Path:
    """A plant of another kind that still carries the robot's joint names, apart from some changes."""
    kind = changes.get("type", "hinge")
    legs = "".join(
        LEG.format(x=0.1 * i, name=changes.get(name, name), type=kind)
        for i, name in enumerate(reversed(robot.joint_names))
    )
    path.write_text(f"<mujoco><worldbody>{BODY.format(base=base, legs=legs)}</worldbody></mujoco>")
    return path


def test_foreign_plant_is_matched_by_joint_name(go1: Robot, tmp_path: Path) -> None:
    model = plant_model(go1, write_plant(tmp_path / "other.xml", go1))
    positions, _ = joint_addresses(model, go1)
    assert positions.tolist() == list(reversed(range(7, 19)))
    assert mujoco.mjtGeom.mjGEOM_PLANE in model.geom_type


@pytest.mark.parametrize(
    ("base", "changes", "message"),
    [
        ("<freejoint/>", {"FL_calf_joint": "knee"}, "no joint 'FL_calf_joint'"),
        ("<freejoint/>", {"type": "slide"}, "not a hinge"),
        ("", {}, "no free joint"),
    ],
)
def test_unfit_plant_is_refused(
    go1: Robot, tmp_path: Path, base: str, changes: dict[str, str], message: str
) -> None:
    path = write_plant(tmp_path / "other.xml", go1, base, **changes)
    with pytest.raises(UserError, match=message) as caught:
        plant_model(go1, path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("text", ["", "garbage", "<mujoco><worldbody>", "<mujoco><nonsense/></mujoco>"])
def test_garbage_plant_is_refused_in_one_line(go1: Robot, tmp_path: Path, text: str) -> None:
    path = tmp_path / "plant.xml"
    path.write_text(text)
    with pytest.raises(UserError, match=r"plant\.xml") as caught:
        plant_model(go1, path)
    assert "\n" not in str(caught.value)


def test_missing_plant_is_refused(go1: Robot, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no MJCF file"):
        plant_model(go1, tmp_path / "absent.xml")
