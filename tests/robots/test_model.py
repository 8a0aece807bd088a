"""Models derived from the one MJCF, for training and for the plant."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from edited import edit
from posed import posed
from refused import refusal_of

from footfall import Robot, UserError, load_robot
from footfall.common.rotations import rotation_matrix
from footfall.robots import mjcf
from footfall.robots.description import available_robots
from footfall.robots.model import ground_friction, joint_addresses, plant_model, read_plant, training_model


def standing(model: mujoco.MjModel, robot: Robot) -> mujoco.MjData:
    """The default pose, the feet a millimetre in the ground."""
    return posed(model, robot, robot.description.standing_height_m - 0.001)


def changed_plant(robot: Robot, path: Path, *changes: tuple[str, str]) -> Path:
    """The robot's own MJCF with some texts changed wherever they stand."""
    text = robot.xml_path.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path.write_text(text)
    return path


def test_standing_costs_sixteen_constraint_rows(go1: Robot) -> None:
    """Four feet cost four edges of a friction pyramid each."""
    data = standing(training_model(go1), go1)
    assert data.ncon == 4
    assert data.efc_type.tolist() == 16 * [mujoco.mjtConstraint.mjCNSTR_CONTACT_PYRAMIDAL]


@pytest.mark.parametrize("name", available_robots())
def test_the_base_of_a_training_model_touches_only_through_listed_pairs(name: str) -> None:
    """Contacts of all other geoms go by bounding volumes, which stay behind when the base's centre of mass is
    moved without `mj_setConst`, as the physics in C does in each episode."""
    robot = load_robot(name)
    model = training_model(robot)
    of_base = model.geom_bodyid == model.body(robot.description.base).id
    assert not (model.geom_contype[of_base] | model.geom_conaffinity[of_base]).any()


@pytest.mark.parametrize("also", ["", 'condim="1"', 'condim="6"', 'solmix="0"'])
@pytest.mark.parametrize("priority", [0, 1])
def test_feet_meet_the_training_floor_as_the_plants(own_folder: Path, priority: int, also: str) -> None:
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


def test_foreign_plant_is_matched_by_joint_name_or_refused_in_one_line(go1: Robot, tmp_path: Path) -> None:
    """The plant has the robot's joints in reverse order, each on a body of its own."""
    path = tmp_path / "other.xml"
    with pytest.raises(UserError):
        plant_model(go1, path)
    legs = "".join(
        f'<body pos="{0.1 * i} 0 0"><joint name="{name}" range="-1 1"/><geom size="0.02"/></body>'
        for i, name in enumerate(reversed(go1.joint_names))
    )
    foreign = f'<body name="base" pos="0 0 1"><freejoint/><geom size="0.1"/>{legs}</body>'
    foreign = f"<mujoco><worldbody>{foreign}</worldbody></mujoco>"
    path.write_text(foreign)
    model = plant_model(go1, path)
    assert joint_addresses(model, go1)[0].tolist() == list(reversed(range(7, 19)))
    assert mujoco.mjtGeom.mjGEOM_PLANE in model.geom_type
    two_missing = foreign.replace("FR_hip_joint", "a").replace("RL_calf_joint", "b")
    for text, named in (
        *((text, "") for text in ("", "garbage", "<mujoco><worldbody>", "<mujoco><nonsense/></mujoco>")),
        (two_missing, ": .*'FR_hip_joint'.*2 of 12"),
        (foreign.replace('range="-1 1"', 'range="-1 1" type="slide"'), ": .*"),
        (foreign.replace("<freejoint/>", ""), ": .*"),
    ):
        path.write_text(text)
        with pytest.raises(UserError, match=rf"^[^\n]*other\.xml{named}[^\n]*\Z"):
            plant_model(go1, path)


TAIL = """<body name="tail" pos="-0.3 0 0"><joint name="tail" frictionloss="0.2" damping="0.03" range="-1 1"/>
  <geom name="tip" size="0.02" mass="0.1" pos="-0.1 0 0"/></body>"""
EXTRAS = """
  <actuator><motor joint="FR_hip_joint"/></actuator>
  <sensor><gyro site="imu"/></sensor>
  <keyframe><key name="home" qpos="1 2 9  1 0 0 0  0  0 0 0 0 0 0 0 0 0 0 0 0"/></keyframe>
  <option integrator="RK4" solver="CG" iterations="70" ls_iterations="70" timestep="0.0003"/>
"""


def test_options_of_the_file_are_dropped_in_training_and_kept_by_a_plant(own_folder: Path) -> None:
    """go1 has a tail without a motor, and actuators, sensors and options in its file.

    The plant replaces only the time step and the integrator RK4.
    """
    edit(own_folder, "robot.xml", '<body name="FR_hip"', TAIL + '<body name="FR_hip"')
    edit(own_folder, "robot.xml", 'axis="1 0 0" range', 'axis="1 0 0" damping="0.4" range')
    edit(own_folder, "robot.xml", "</mujoco>", EXTRAS + "</mujoco>")
    laden = load_robot(own_folder)
    model = training_model(laden, timestep_s=0.004)
    assert (model.nu, model.nsensor, model.nkey, model.ngeom) == (0, 0, 0, 9)
    assert not model.jnt_limited.any()
    options = model.opt
    assert (options.timestep, training_model(laden).opt.timestep) == (0.004, 0.005)
    assert options.integrator == mujoco.mjtIntegrator.mjINT_EULER
    assert options.solver == mujoco.mjtSolver.mjSOL_NEWTON
    assert options.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
    assert (options.impratio, options.iterations, options.ls_iterations) == (1.0, 1, 5)
    assert options.disableflags == mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    options = plant_model(laden).opt
    assert options.integrator == mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert options.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    assert (options.timestep, options.impratio, options.iterations) == (0.001, 10.0, 70)
    euler = changed_plant(laden, own_folder / "euler.xml", ('"RK4"', '"Euler"'))
    assert plant_model(laden, euler).opt.integrator == mujoco.mjtIntegrator.mjINT_EULER


def test_a_plant_that_gives_some_reflected_inertia_keeps_its_own(go1: Robot, tmp_path: Path) -> None:
    path = changed_plant(go1, tmp_path / "plant.xml", (' armature="0.00403"', ""), ("0.00906", "0.02"))
    plant = read_plant(go1, path)
    np.testing.assert_array_equal(plant.model.dof_armature[6:], np.tile([0.0, 0.0, 0.02], 4))
    assert plant.notes == ()


def test_a_missing_floor_is_added(go1: Robot, tmp_path: Path) -> None:
    hill = '<hfield name="hill" nrow="2" ncol="2" size="5 5 1 1" elevation="0 0 1 1"/>'
    for ground, planes in (
        ('type="plane" size="0 0 1"', 1),
        ('type="plane" size="0 0 1" contype="0"', 1),
        ('type="plane" size="0 0 1" conaffinity="0"', 1),
        ('type="plane" size="0 0 1" contype="0" conaffinity="0"', 2),
        ('type="hfield" hfield="hill"', 0),
        ('type="box" size="1 1 1" pos="9 0 0"', 1),
    ):
        changes = ("<asset>", f"<asset>{hill}"), ("<worldbody>", f"<worldbody><geom {ground}/>")
        model = read_plant(go1, changed_plant(go1, tmp_path / "plant.xml", *changes)).model
        kinds = model.geom_type[model.geom_bodyid == 0]
        assert (kinds == mujoco.mjtGeom.mjGEOM_PLANE).sum() == planes, ground


def test_a_plants_imu_has_the_robots_position_and_rotation(own_folder: Path, tmp_path: Path) -> None:
    """Thrown, tilted and spinning, the IMU measures a + dw/dt x r + w x (w x r)."""
    edit(own_folder, "robot.xml", '"-0.01592 -0.06659 -0.00617"', '"0.11 -0.07 0.05" euler="0 0 1"')
    robot = load_robot(own_folder)
    moved = changed_plant(robot, tmp_path / "plant.xml", ('pos="0.11 -0.07 0.05"', 'pos="0 0 0"'))
    plant = read_plant(robot, moved)
    model = plant.model
    data, spin = posed(model, robot, 9.0), np.array([2.0, -3.0, 4.0])
    data.qpos[3:7] = np.array([0.8, 0.3, -0.2, 0.48]) / np.linalg.norm([0.8, 0.3, -0.2, 0.48])
    data.qvel[:6] = 0.5, 0.2, -0.1, *spin
    mujoco.mj_forward(model, data)
    turned = rotation_matrix(data.qpos[3:7])
    arm, spun = np.array([0.11, -0.07, 0.05]), data.qacc[3:6]
    origin = turned.T @ (data.qacc[:3] - model.opt.gravity)
    measured = origin + np.cross(spun, arm) + np.cross(spin, np.cross(spin, arm))
    assert model.nsensordata == 3
    np.testing.assert_allclose(data.sensordata, measured, atol=1e-9)
    assert plant.base == model.body("trunk").id


def test_feet_with_and_without_priority_each_have_their_friction(own_folder: Path) -> None:
    """The friction is the foot's own if it has priority, else the larger of it and the floor's 0.8."""
    for leg, settings in (
        ("FR", 'priority="0" friction="0.3"'),
        ("FL", 'priority="1" friction="0.4"'),
        ("RR", 'priority="0" friction="1.5"'),
        ("RL", 'priority="2" friction="0.1"'),
    ):
        foot = f'name="{leg}_foot" class="foot"'
        edit(own_folder, "robot.xml", foot, f"{foot} {settings}")
    robot = load_robot(own_folder)
    model = training_model(robot)
    expected = [0.8, 0.4, 1.5, 0.1]
    np.testing.assert_allclose(ground_friction(model, robot), expected)
    contact = standing(model, robot).contact
    for foot, friction in zip(robot.description.feet, expected, strict=True):
        (row,) = np.flatnonzero((contact.geom == model.geom(foot.geoms[0]).id).any(axis=1))
        assert contact.friction[row, 0] == pytest.approx(friction)


def test_feet_missing_or_renamed_in_a_plant_are_noted(go1: Robot, tmp_path: Path) -> None:
    removed = [(f'<geom name="{leg}_foot" class="foot"/>', "") for leg in ("FR", "RL")]
    renamed = ('"FL_foot"', '"toe"'), ('"RR_foot"', '"tip"')
    plant = read_plant(go1, changed_plant(go1, tmp_path / "plant.xml", *removed, *renamed))
    toe, tip = (plant.model.geom(name).id for name in ("toe", "tip"))
    assert [geoms.tolist() for geoms in plant.feet] == [[], [toe], [tip], []]
    absent, found = plant.notes
    assert "no geom FR_foot, RL_foot:" in absent
    assert found.endswith("FL_foot is toe of body FL_calf, RR_foot is tip of body RR_calf")
    own = read_plant(go1)
    names = [[own.model.geom(geom).name for geom in geoms] for geoms in own.feet]
    assert names == [list(foot.geoms) for foot in go1.description.feet]


def test_large_assets_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo's compiler crashes at them. Reading a large height field takes seconds, so its limit is low."""
    for limit, asset in (
        (mjcf.MAX_POINTS, '<texture name="big" type="2d" builtin="flat" width="60000" height="60000"/>'),
        (99**2, '<hfield name="big" nrow="100" ncol="100" size="1 1 1 1"/>'),
    ):
        monkeypatch.setattr(mjcf, "MAX_POINTS", limit)
        (tmp_path / "robot.xml").write_text(f"<mujoco><asset>{asset}</asset></mujoco>")
        assert "'big'" in refusal_of(mjcf.load_spec, tmp_path / "robot.xml")
