"""A machine built from a source."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from foreign_robots import UNUSUAL, limb, on_base, read
from posed import mass_matrix

from footfall.common.errors import UserError
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.model_xml import model_xml
from footfall.robots.importer.shapes import Kind, rotation_of


def test_every_link_moves_as_in_the_source(tmp_path: Path) -> None:
    """The MJCF has angles at zero, anchors, rotated frames and a shared waist.

    Feet, boxes and the mass matrix are compared relative to the base; the arm is held at 0.4 rad.
    """
    source = read(tmp_path, UNUSUAL)
    machine, guesses = build_machine(source, "odd")
    original, converted = source.model, mujoco.MjModel.from_xml_string(model_xml(machine))
    for seed in range(2):
        rng = np.random.default_rng(seed)
        data = mujoco.MjData(original), mujoco.MjData(converted)
        for hinge in machine.hinges:
            angle = rng.uniform(-0.5, 0.5)
            for each in data:
                each.joint(hinge.name).qpos = angle
        data[0].joint("arm").qpos = 0.4
        bases = original.body("pelvis").id, 1
        positions, matrices = [], []
        for model, each, base in zip((original, converted), data, bases, strict=True):
            mujoco.mj_forward(model, each)
            turn = each.xmat[base].reshape(3, 3)
            kinds = (model.geom_type == Kind.mjGEOM_BOX, np.isin(model.geom_size[:, 0], (0.025, 0.03, 0.04)))
            seen = [(each.geom_xpos[kind] - each.xpos[base]) @ turn for kind in kinds]
            axes = np.abs(turn.T @ each.geom_xmat[kinds[0]].reshape(-1, 3, 3))
            positions.append(np.concatenate([*seen, *axes]))
            full = mass_matrix(model, each, [hinge.name for hinge in machine.hinges])
            matrices.append(full[6:, 6:])
        np.testing.assert_allclose(positions[1], positions[0], atol=2e-5)
        np.testing.assert_allclose(matrices[1], matrices[0], atol=2e-5)
    assert [guess for guess in guesses if "rigid" in guess] == [
        "joints that move no foot are rigid, as near to zero as their ranges allow: arm"
    ]


def test_the_xml_keeps_a_foots_contact_parameters_a_light_links_inertia_and_the_height(
    tmp_path: Path,
) -> None:
    machine, _ = build_machine(read(tmp_path, UNUSUAL), "odd")
    light = replace(machine.links[-1], inertia=np.diag([3e-7, 4e-7, 5e-7]) + 1e-8 * (1 - np.eye(3)))
    feather = replace(machine, links=(*machine.links[:-1], light))
    model = mujoco.MjModel.from_xml_string(model_xml(feather, 0.75))
    axes = rotation_of(model.body_iquat[-1])
    np.testing.assert_allclose(axes @ np.diag(model.body_inertia[-1]) @ axes.T, light.inertia, atol=2e-9)
    foot = model.geom(machine.legs[1].geoms[0])
    assert (foot.friction[0], foot.contype[0], foot.conaffinity[0]) == (1.3, 2, 5)
    assert (foot.priority[0], foot.condim[0]) == (1, 3)
    assert model.body_pos[1].tolist() == [0.0, 0.0, 0.75]
    assert (model.opt.cone, model.opt.impratio) == (mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0)
    ET.fromstring(model_xml(machine, notes=["no comment of XML may hold --"]))


LIGHT = """<body name="light" pos="0 0.1 0" euler="0.3 0 0"><joint name="first" axis="1 0 0" range="-1 1"/>
  <inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>{}</body>"""


def test_a_massless_link_with_a_contact_or_two_children_is_refused(tmp_path: Path) -> None:
    child = limb("a_foot", 0.05, 0.6)
    for extra in ('<geom size="0.01" mass="0"/>', limb("b_foot", 0.1, 0.4)):
        with pytest.raises(UserError):
            build_machine(read(tmp_path, on_base(LIGHT.format(child + extra), limb("c", -0.1, 0.4))), "x")


def test_links_behind_a_massless_link_keep_their_parents(tmp_path: Path) -> None:
    shin = limb("c_foot", 0.0, 0.4).replace('pos="0 0.0 0"', 'pos="0 0 -0.2"')
    text = on_base(LIGHT.format(limb("a_foot", 0.05, 0.6)), limb("c", -0.1, 0.2, shin))
    machine, _ = build_machine(read(tmp_path, text), "x")
    links = [(link.name, link.parent) for link in machine.links]
    assert links == [("base", -1), ("a_foot", 0), ("c", 0), ("c_foot", 2)]
    assert [hinge.name for hinge in machine.links[1].hinges] == ["first", "a_foot_joint"]
