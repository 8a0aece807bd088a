"""The feet touch the ground at the standing height."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from edited import edit
from posed import posed
from refused import refusal_of

from footfall import Robot, load_robot
from footfall.robots.mjcf import load_spec
from footfall.robots.rigid_body import nominal_body
from footfall.robots.stance import base_corners, in_default_pose, touching_height


@pytest.mark.parametrize(
    "foot",
    [
        'type="sphere" size="0.03"',
        'type="capsule" size="0.02 0.01"',
        'type="capsule" size="0.02 0.01" quat="0 1 0 0"',  # its axis points down
        'type="cylinder" size="0.02 0.01"',
        'type="ellipsoid" size="0.03 0.02 0.01"',
        'type="box" size="0.03 0.02 0.01"',
        'type="mesh" mesh="wedge"',
    ],
)
def test_feet_of_any_shape_touch_with_their_lowest_point(go1: Robot, own_folder: Path, foot: str) -> None:
    """MuJoCo finds contact a tenth of a millimetre lower, and no contact a tenth higher."""
    text = (own_folder / "robot.xml").read_text()
    meshes = """<mesh name="first" vertex="0 0 0 0.9 0 0 0 0.9 0 0 0 -0.9"/>
      <mesh name="wedge" vertex="0 0 -0.03 0.05 0 0 0 0.04 0 0 0 0"/>
      <mesh name="last" vertex="0 0 0 0.8 0 0 0 0.8 0 0 0 -0.8"/>"""
    text = text.replace('type="sphere" size="0.023"', foot).replace("<asset>", f"<asset>{meshes}")
    text = text.replace("<worldbody>", '<worldbody><geom type="plane" size="0 0 1"/>')
    model = mujoco.MjModel.from_xml_string(text)
    height = touching_height(go1.description, model)
    for lifted, touches in ((-1e-4, True), (1e-4, False)):
        assert (posed(model, go1, height + lifted).ncon > 0) is touches


def test_a_height_at_which_no_foot_touches_is_refused(own_folder: Path) -> None:
    before = "0.2945"
    for declared, accepted in (("0.278", False), ("2.0", False), ("0.299", True), ("0.290", True)):
        edit(own_folder, "robot.yaml", f"height_m: {before}", f"height_m: {declared}")
        if accepted:
            load_robot(own_folder)
        else:
            assert re.search(r"standing_height_m: .*0\.2945", refusal_of(load_robot, own_folder))
        before = declared


def test_the_rigid_body_has_mujocos_mass_centre_and_inertia(own_folder: Path) -> None:
    """The momenta about each axis are equal in the default pose. The gate is not a part of the robot.

    The robot is a go1 with a tail and an initially rotated trunk; the gate stands before it.
    """
    gate = '<body pos="3 0 1"><joint name="gate" axis="0 0 1" ref="0.7"/><geom size="0.2" mass="5"/></body>'
    tail = """<body name="tail" pos="-0.3 0.05 0.1"><joint name="tail" axis="0 1 0" ref="0.4"/>
      <geom size="0.03" pos="-0.1 0 0" mass="0.7" contype="0" conaffinity="0"/></body>"""
    edit(own_folder, "robot.xml", "<worldbody>", f"<worldbody>{gate}")
    edit(own_folder, "robot.xml", '<body name="FR_hip"', f'{tail}<body name="FR_hip"')
    edit(own_folder, "robot.xml", 'pos="0 0 0.445"', 'pos="0.2 0.3 0.445" euler="0.2 0.3 1.1"')
    thigh = "RR_thigh_joint, motor: hip,  default_rad"
    edit(own_folder, "robot.yaml", f"{thigh}: 0.9", f"{thigh}: 0.7")
    altered = load_robot(own_folder)
    model = load_spec(altered.xml_path).compile()
    data = in_default_pose(model, altered.description)
    body, trunk = nominal_body(altered), model.body("trunk").id
    mujoco.mj_forward(model, data)
    assert body.mass == pytest.approx(model.body_mass.sum() - 5.0)
    weights = model.body_mass[trunk:, None] * data.xipos[trunk:]
    np.testing.assert_allclose(body.centre, weights.sum(axis=0) / body.mass, atol=1e-12)
    for axis in range(3):
        data.qvel[:] = 0.0
        data.qvel[1 + 3 + axis] = 1.0
        mujoco.mj_forward(model, data)
        mujoco.mj_subtreeVel(model, data)
        np.testing.assert_allclose(body.inertia[axis], data.subtree_angmom[trunk], atol=1e-12)


def test_a_box_around_the_base_holds_all_its_colliding_geoms(go1: Robot, own_folder: Path) -> None:
    """The trunk reaches 0.13, 0.09 and 0.05 m; a sphere at its front and a wedge below reach farther."""
    text = (own_folder / "robot.xml").read_text()
    box = '<geom class="collision" type="box" size="0.13 0.09 0.05"/>'
    assert text.count(box) == 1
    sphere = '<geom class="collision" type="sphere" size="0.03" pos="0.2 0 0"/>'
    wedge = '<geom class="collision" type="mesh" mesh="wedge" pos="0 0 -0.1" quat="0 1 0 0"/>'  # upside down
    mesh = '<asset><mesh name="wedge" vertex="0 0 0 0.05 0 0 0 0.04 0 0 0 0.03" inertia="shell"/></asset>'
    text = text.replace(box, box + sphere + wedge).replace("<worldbody>", mesh + "<worldbody>", 1)
    corners = base_corners(go1.description, mujoco.MjModel.from_xml_string(text))
    assert corners.min(axis=0).tolist() == pytest.approx([-0.13, -0.09, -0.13])
    assert corners.max(axis=0).tolist() == pytest.approx([0.23, 0.09, 0.05])
    assert len({tuple(corner) for corner in corners.tolist()}) == 8
