"""The steps of `footfall robot new`, each by itself, against figures worked out by hand."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest
import yaml
from foreign_robots import BIPED_MJCF, quadruped
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.deploy.drivers.mit import RANGES
from footfall.robots.description import load_robot
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.create import ImportRequest, import_robot
from footfall.robots.importer.feet import is_sole, stand_on
from footfall.robots.importer.limbs import FOOT_NAME, Limb, find_limbs
from footfall.robots.importer.machine import Geom, Hinge, Leg, Link, Machine
from footfall.robots.importer.meshes import read_points
from footfall.robots.importer.model_xml import model_xml
from footfall.robots.importer.motors import Drive, JointMotor, choose_drive, peak_torques
from footfall.robots.importer.pose import Pose, _LegSearch, lowest_height, standing_pose
from footfall.robots.importer.robot_yaml import choose_protocols, robot_yaml
from footfall.robots.importer.shapes import (
    Kind,
    Shape,
    fit_shape,
    fit_sole,
    lowest_point,
    quaternion_of,
    rotation_of,
    support,
)
from footfall.robots.importer.source import Source, read_source
from footfall.robots.importer.statics import Statics, statics

UP = np.array([0.0, 0.0, 1.0])
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
TURN = Rotation.from_euler("xyz", [0.4, -0.7, 1.1])
PLACE = np.array([0.3, -0.2, 0.5])


def turned(*angles: float) -> np.ndarray:
    """Quaternion w x y z of turns about the fixed x, y and z."""
    return Rotation.from_euler("xyz", angles).as_quat(scalar_first=True)


# -- shapes ------------------------------------------------------------------------------------------


def surface(kind: mujoco.mjtGeom, size: Sequence[float]) -> np.ndarray:
    """Points all over a primitive about the origin, (k, 3)."""
    rng = np.random.default_rng(2)
    ball = rng.normal(size=(200_000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    match kind:
        case Kind.mjGEOM_SPHERE:
            return size[0] * ball
        case Kind.mjGEOM_CAPSULE:
            return size[0] * ball + np.outer(np.sign(ball[:, 2]) * size[1], UP)
        case Kind.mjGEOM_CYLINDER:
            rim = ball[:, :2] / np.linalg.norm(ball[:, :2], axis=1, keepdims=True)
            return np.column_stack([size[0] * rim, np.sign(ball[:, 2]) * size[1]])
        case Kind.mjGEOM_ELLIPSOID:
            return np.array(size) * ball
    return np.array(size) * np.sign(ball)


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        (Kind.mjGEOM_SPHERE, (0.07, 0.0, 0.0)),
        (Kind.mjGEOM_CAPSULE, (0.03, 0.1, 0.0)),
        (Kind.mjGEOM_CYLINDER, (0.05, 0.1, 0.0)),
        (Kind.mjGEOM_ELLIPSOID, (0.03, 0.06, 0.1)),
        (Kind.mjGEOM_BOX, (0.03, 0.06, 0.1)),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_shape_reaches_as_far_and_as_low_as_its_surface(
    kind: mujoco.mjtGeom, size: tuple[float, ...], sign: float
) -> None:
    up = sign * np.array([0.8, 0.36, 0.48])
    shape = Shape(kind, np.array(size), PLACE, TURN.as_quat(scalar_first=True))
    points = TURN.apply(surface(kind, size)) + PLACE
    assert support(shape, up) == pytest.approx(((points - PLACE) @ up).max(), abs=2e-4)
    lowest = lowest_point(shape, up)
    assert lowest @ up == pytest.approx((points @ up).min(), abs=2e-4)
    np.testing.assert_allclose(lowest, points[(points @ up).argmin()], atol=3e-3)


def test_of_what_is_nearly_level_the_middle_is_lowest() -> None:
    """A rod and a brick that lean by 0.03 rad."""
    up = np.array([np.sin(0.03), 0.0, np.cos(0.03)])
    rod = Shape(Kind.mjGEOM_CAPSULE, np.array([0.02, 0.3, 0.0]), PLACE, turned(0.0, np.pi / 2, 0.0))
    np.testing.assert_allclose(lowest_point(rod, up), PLACE - 0.02 * up, atol=1e-9)
    brick = Shape(Kind.mjGEOM_BOX, np.array([0.3, 0.1, 0.05]), PLACE, LEVEL)
    np.testing.assert_allclose(lowest_point(brick, up), PLACE - [0.0, 0.0, 0.05], atol=1e-9)


def test_rotations_are_scipys() -> None:
    np.testing.assert_allclose(rotation_of(TURN.as_quat(scalar_first=True)), TURN.as_matrix(), atol=1e-12)
    found = quaternion_of(TURN.as_matrix())
    np.testing.assert_allclose(Rotation.from_quat(found, scalar_first=True).as_matrix(), TURN.as_matrix())


@pytest.mark.parametrize("axis", range(3))
def test_a_rod_along_any_of_the_links_axes_is_a_capsule_along_it(axis: int) -> None:
    points = surface(Kind.mjGEOM_CAPSULE, (0.02, 0.1))[:4000, np.roll([0, 1, 2], axis - 2)] + PLACE
    shape, _ = fit_shape(points)
    assert shape.kind == Kind.mjGEOM_CAPSULE
    assert shape.size[:2] == pytest.approx([0.02, 0.1], rel=0.05)
    np.testing.assert_allclose(np.abs(rotation_of(shape.quaternion)[:, 2]), np.eye(3)[axis], atol=1e-6)
    np.testing.assert_allclose(shape.position, PLACE, atol=2e-3)


def test_a_brick_askew_is_boxed_along_its_own_axes() -> None:
    shape, _ = fit_shape(TURN.apply(surface(Kind.mjGEOM_BOX, (0.05, 0.1, 0.2))[:500]) + PLACE)
    assert shape.kind == Kind.mjGEOM_BOX
    assert sorted(shape.size) == pytest.approx([0.05, 0.1, 0.2], rel=0.02)
    np.testing.assert_allclose(shape.position, PLACE, atol=1e-3)


def test_a_sole_points_where_the_links_x_axis_does() -> None:
    """0.2 by 0.08 m, on an ankle that leans a little both ways."""
    frame = Rotation.from_euler("XY", [0.1, 0.3])
    corners = np.array([[x, y, 0.0] for x in (-0.05, 0.15) for y in (-0.04, 0.04)])
    shape = fit_sole(frame.apply(corners) + PLACE, frame.apply(UP))
    assert shape.size == pytest.approx([0.1, 0.04, 0.01])
    np.testing.assert_allclose(shape.position, frame.apply([0.05, 0.0, 0.01]) + PLACE, atol=1e-9)


# -- feet --------------------------------------------------------------------------------------------


def geom(name: str, kind: mujoco.mjtGeom, size: Sequence[float], at: Sequence[float], **rest: Any) -> Geom:
    sizes = np.zeros(3)
    sizes[: len(size)] = size
    shape = Shape(kind, sizes, np.array(at, dtype=float), rest.pop("turn", LEVEL))
    return Geom(name, shape, 0.7, 1, 1, **{"of_body": "shank", **rest})


def foot_of(
    *geoms: Geom, up: np.ndarray = UP, joints: int = 3, feet: Sequence[str] = ()
) -> tuple[list[Geom], list[Geom]]:
    """What a link's foot stands on, and its other geoms."""
    link = Link("shank", 1, np.zeros(3), LEVEL, 1.0, np.zeros(3), np.eye(3), (), geoms)
    limb = Limb(tuple(f"j{k}" for k in range(joints)), (4,), frozenset(feet))
    made, leg = stand_on(link, 2, limb, limb.joints[1:], "FL", up)
    assert (leg.name, leg.joints, leg.link) == ("FL", limb.joints[1:], 2)
    return [g for g in made.geoms if g.name in leg.geoms], [g for g in made.geoms if g.name not in leg.geoms]


def ball(name: str, low: float, radius: float = 0.02, x: float = 0.0, **rest: Any) -> Geom:
    """One whose lowest point is at a height."""
    return geom(name, Kind.mjGEOM_SPHERE, [radius], [x, 0.0, low + radius], **rest)


class TestFeet:
    def test_balls_that_are_level_within_a_centimetre_touch_together(self) -> None:
        feet, others = foot_of(ball("a", -0.2), ball("b", -0.192, 0.03, 0.1), ball("c", -0.188, 0.01, -0.1))
        assert [g.name for g in feet] == ["FL_foot_1", "FL_foot_2"]
        assert [g.shape.size[0] for g in feet] == [0.02, 0.03]
        assert [g.name for g in others] == ["c"]

    def test_parts_that_are_called_feet_go_before_lower_ones(self) -> None:
        feet, others = foot_of(ball("spur", -0.3), ball("paw", -0.2, of_body="foot"), feet=["foot"])
        assert [g.name for g in feet] == ["FL_foot"]
        assert feet[0].shape.position[2] == pytest.approx(-0.18)
        assert [g.name for g in others] == ["spur"]

    def test_down_is_where_the_link_says_that_it_is(self) -> None:
        feet, _ = foot_of(ball("a", -0.2), ball("b", 0.16), up=-UP)
        assert feet[0].shape.position[2] == pytest.approx(0.18)

    @pytest.mark.parametrize(("half_height", "radius"), [(0.02, 0.005), (0.008, 0.004)])
    @pytest.mark.parametrize("sign", [1.0, -1.0])
    def test_a_sole_stands_on_balls_at_its_corners_and_the_rest_is_clear_of_the_ground(
        self, half_height: float, radius: float, sign: float
    ) -> None:
        """A box of 0.24 by 0.1 m, a quarter turn about the vertical, on a link that may hang upside down."""
        quarter = turned(0.0, 0.0, np.pi / 2)
        box = geom("sole", Kind.mjGEOM_BOX, [0.12, 0.05, half_height], [0.3, 0.2, 0.1], turn=quarter)
        feet, others = foot_of(box, up=sign * UP)
        places = np.array([g.shape.position for g in feet])
        assert [g.shape.size[0] for g in feet] == [radius] * 4
        assert sorted(set(places[:, 0].round(9))) == pytest.approx([0.25 + radius, 0.35 - radius])
        assert sorted(set(places[:, 1].round(9))) == pytest.approx([0.08 + radius, 0.32 - radius])
        assert places[:, 2] == pytest.approx(np.full(4, 0.1 - sign * (half_height - radius)))
        shape = others[0].shape
        ends = shape.position[2] + np.array([-1.0, 1.0]) * sign * shape.size[2]
        assert ends == pytest.approx([0.1 - sign * (half_height - radius), 0.1 + sign * half_height])
        assert {g.friction for g in feet} == {0.7}

    @pytest.mark.parametrize(
        ("size", "lean", "flat"),
        [
            ((0.1, 0.05, 0.02), 0.2, True),
            ((0.1, 0.05, 0.02), 0.3, False),
            ((0.02, 0.05, 0.1), np.pi / 2, True),
            ((0.1, 0.05, 0.06), 0.0, False),
        ],
    )
    def test_a_sole_is_a_flat_box_that_leans_by_less_than_fourteen_degrees(
        self, size: tuple[float, ...], lean: float, flat: bool
    ) -> None:
        shape = Shape(Kind.mjGEOM_BOX, np.array(size), PLACE, turned(0.0, lean, 0.0))
        assert bool(is_sole(shape, UP)) is flat
        assert not is_sole(shape._replace(kind=Kind.mjGEOM_ELLIPSOID), UP)

    @pytest.mark.parametrize("way", [0.0, np.pi])
    def test_a_rod_is_drawn_back_by_the_ball_at_its_end(self, way: float) -> None:
        """Radius 0.03, from 0.03 m above to 0.23 m below the joint, along its axis or against it."""
        rod = geom("rod", Kind.mjGEOM_CAPSULE, [0.03, 0.1], [0.0, 0.0, -0.1], turn=turned(way, 0.0, 0.0))
        feet, others = foot_of(rod)
        assert (feet[0].shape.kind, feet[0].shape.size[0]) == (Kind.mjGEOM_SPHERE, 0.03)
        np.testing.assert_allclose(feet[0].shape.position, [0.0, 0.0, -0.2], atol=1e-9)
        rest = others[0].shape
        ends = rest.position[2] + np.array([-1.0, 1.0]) * (rest.size[1] + rest.size[0])
        assert ends == pytest.approx([-0.2, 0.03])

    def test_a_thick_rod_ends_in_a_ball_of_four_centimetres(self) -> None:
        feet, _ = foot_of(geom("rod", Kind.mjGEOM_CAPSULE, [0.07, 0.1], [0.0, 0.0, -0.1]))
        assert feet[0].shape.size[0] == 0.04
        assert feet[0].shape.position[2] == pytest.approx(-0.27 + 0.04)

    def test_a_tall_box_ends_in_a_ball_as_wide_as_its_narrow_side(self) -> None:
        feet, others = foot_of(geom("box", Kind.mjGEOM_BOX, [0.03, 0.02, 0.1], [0.1, 0.0, -0.1]))
        assert feet[0].shape.size[0] == 0.02
        np.testing.assert_allclose(feet[0].shape.position, [0.1, 0.0, -0.18], atol=1e-9)
        assert others[0].shape.size.tolist() == pytest.approx([0.03, 0.02, 0.09])
        assert others[0].shape.position[2] == pytest.approx(-0.09)

    def test_nothing_is_left_of_a_rod_that_lies_along_the_ground_or_is_short(self) -> None:
        lying = geom("rod", Kind.mjGEOM_CAPSULE, [0.02, 0.1], [0.0, 0.0, -0.1], turn=turned(0.0, 1.4, 0.0))
        short = geom("rod", Kind.mjGEOM_CAPSULE, [0.03, 0.01], [0.0, 0.0, -0.1])
        for each in (lying, short):
            feet, others = foot_of(each)
            assert len(feet) == 1
            assert others == []

    @pytest.mark.parametrize(("joints", "corners"), [(4, 1), (5, 4)])
    def test_a_mesh_becomes_a_sole_where_an_ankle_can_hold_it_level(self, joints: int, corners: int) -> None:
        points = np.array([[x, y, z] for x in (-0.05, 0.15) for y in (-0.04, 0.04) for z in (-0.1, 0.0)])
        shoe = replace(
            geom("shoe", Kind.mjGEOM_ELLIPSOID, [0.1, 0.04, 0.05], [0.05, 0, -0.05]), points=points
        )
        feet, _ = foot_of(shoe, joints=joints)
        assert len(feet) == corners
        assert all(g.shape.position[2] - support(g.shape, UP) == pytest.approx(-0.1) for g in feet)


# -- limbs -------------------------------------------------------------------------------------------


def read(tmp_path: Path, text: str, suffix: str = "xml") -> Source:
    path = tmp_path / f"m.{suffix}"
    path.write_text(text)
    return read_source(path)


def hanging(name: str, y: float, length: float, inner: str = "", joint: str = "") -> str:
    """A limb of one hinge with a ball at its end."""
    return f"""<body name="{name}" pos="0 {y} 0"><joint name="{name}_joint" axis="0 1 0" range="-1 1"/>
      <geom name="{name}_ball" size="0.02" pos="0 0 {0.02 - length}" mass="0.3"/>{joint}{inner}</body>"""


def on_base(*limbs: str, extra: str = "") -> str:
    return f"""<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
      <body name="base" pos="0 0 2"><freejoint/><geom size="0.1" mass="3"/>{"".join(limbs)}</body>
      </worldbody>{extra}</mujoco>"""


def feet_of(source: Source, *named: str) -> list[str]:
    limbs = find_limbs(source, named)
    return [source.model.body(leg.bodies[0]).name for leg in limbs.legs]


class TestLimbs:
    @pytest.mark.parametrize(
        ("name", "called"),
        [("FL_foot", True), ("toe_2", True), ("l_toes", True), ("Paw1", True)]
        + [("Sole", True), ("feet", True), ("stoel", False), ("tow_hook", False), ("shank", False)],
    )
    def test_what_is_called_a_foot(self, name: str, called: bool) -> None:
        assert bool(FOOT_NAME.search(name)) is called

    def test_without_names_they_are_those_that_reach_seven_tenths_as_low(self, tmp_path: Path) -> None:
        limbs = hanging("a", 0.1, 0.5), hanging("b", -0.1, 0.36), hanging("arm", 0.2, 0.34)
        assert feet_of(read(tmp_path, on_base(*limbs))) == ["a", "b"]

    def test_names_go_before_depth_but_not_above_the_base(self, tmp_path: Path) -> None:
        limbs = hanging("tail", 0.0, 0.9), hanging("foot_1", 0.1, 0.3), hanging("foot_2", -0.1, 0.2)
        up = hanging("foot_3", 0.3, -0.3)
        assert feet_of(read(tmp_path, on_base(*limbs, up))) == ["foot_1", "foot_2"]

    def test_a_geom_or_a_site_may_bear_the_name(self, tmp_path: Path) -> None:
        one = hanging("a", 0.1, 0.2, '<site name="left_foot"/>')
        two = hanging("b", -0.1, 0.2, '<geom name="right_foot" size="0.01" mass="0"/>')
        source = read(tmp_path, on_base(one, two, hanging("tail", 0.0, 0.9)))
        assert feet_of(source) == ["a", "b"]
        assert [leg.foot_bodies for leg in find_limbs(source).legs] == [{"a"}, {"b"}]

    def test_a_limb_ends_where_no_joint_follows_also_behind_a_fixed_part(self, tmp_path: Path) -> None:
        def leg(name: str, y: float) -> str:
            shank = hanging(f"{name}_shank", 0.0, 0.3)
            return hanging(
                f"{name}_thigh", y, 0.02, f'<body name="{name}_bracket" pos="0 0 -0.2">{shank}</body>'
            )

        source = read(tmp_path, on_base(leg("l", 0.1), leg("r", -0.1)))
        assert feet_of(source) == ["l_shank", "r_shank"]
        assert find_limbs(source).legs[1].joints == ("r_thigh_joint", "r_shank_joint")

    def test_a_part_that_is_fixed_to_the_end_names_it_too(self, tmp_path: Path) -> None:
        toe = '<body name="{}_pad" pos="0 0 -0.2"><geom size="0.01" mass="0.01"/></body>'
        limbs = (hanging(name, y, 0.2, toe.format(name)) for name, y in (("a", 0.1), ("b", -0.1)))
        source = read(tmp_path, on_base(*limbs))
        assert feet_of(source, "b_pad", "a") == ["b", "a"]
        assert find_limbs(source, ("b_pad", "a")).guesses == ()
        assert len(find_limbs(source).guesses) == 1

    def test_the_base_is_the_free_body_with_the_most_joints(self, tmp_path: Path) -> None:
        text = on_base(hanging("a", 0.1, 0.2), hanging("b", -0.1, 0.2))
        crate = '<worldbody><body name="crate"><freejoint/><geom size="1"/></body>'
        source = read(tmp_path, text.replace("<worldbody>", crate))
        assert source.model.body(find_limbs(source).base).name == "base"

    @pytest.mark.parametrize(
        ("old", "new", "says"),
        [
            ('name="b_joint" axis="0 1 0" range="-1 1"', 'name="b_joint" axis="0 1 0"', "b_joint of a leg has no lim"),
            ('name="b_joint" axis="0 1 0"', 'name="b_joint" type="slide"', "is a slide joint"),
            ("</mujoco>", "<equality>{}</equality></mujoco>".format('<joint joint1="b_joint" joint2="a_joint"/>'),
             "b_joint of a leg follows another one"),
            ("</mujoco>", "<equality>{}</equality></mujoco>".format('<weld name="w" body1="a" body2="b"/>'),
             "equality w closes a loop"),
            ('pos="0 -0.1 0"', 'pos="0 -0.1 0.19"', "only one foot, a, found"),
        ],
    )  # fmt: skip
    def test_what_cannot_be_driven_is_named(self, tmp_path: Path, old: str, new: str, says: str) -> None:
        text = on_base(hanging("a", 0.1, 0.2), hanging("b", -0.1, 0.2))
        assert old in text
        with pytest.raises(UserError, match=says):
            find_limbs(read(tmp_path, text.replace(old, new)))

    def test_a_loop_that_is_switched_off_closes_nothing(self, tmp_path: Path) -> None:
        loop = '<equality><weld body1="a" body2="b" active="false"/></equality>'
        source = read(tmp_path, on_base(hanging("a", 0.1, 0.2), hanging("b", -0.1, 0.2), extra=loop))
        assert feet_of(source) == ["a", "b"]


# -- machines ----------------------------------------------------------------------------------------

ODD_LEG = """<body name="{0}_hip" pos="0.1 {1} 0" euler="0.1 0.2 {2}">
  <joint name="{0}_roll" axis="1 0.1 0" pos="0.01 0.02 -0.03" ref="0.3" range="-0.6 0.9" damping="0.3"/>
  <joint name="{0}_pitch" axis="0 1 0.1" pos="0 -0.01 0.02" range="-1.2 1" frictionloss="0.4"/>
  <geom type="capsule" fromto="0 0 0 0.02 0 -0.2" size="0.03" mass="1.1"/>
  <body name="{0}_bracket" pos="0.02 0 -0.2" euler="0.3 0 0.2"><geom size="0.01" mass="0.1"/>
    <body name="{0}_shank" pos="0.01 0.01 0" euler="0 1.2 0">
      <joint name="{0}_knee" axis="0 1 0" ref="-0.5" range="-2 -0.1"/>
      <geom type="box" pos="0.1 0 0" size="0.1 0.01 0.02" mass="0.5" euler="0.1 0 0"/>
      <body name="{0}_foot" pos="0.22 0 0" euler="0.2 0.1 0.3">
        <geom name="{0}_ball" size="0.025" pos="0.01 0 0" mass="0.07" friction="1.3" contype="2" conaffinity="5"/>
      </body></body></body></body>"""
ODD = f"""<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
  <body name="stand" pos="9 9 9"><joint name="crank"/><geom size="0.3" mass="7"/></body>
  <body name="pelvis" pos="0.3 0.2 1" euler="0.3 -0.2 0.9"><freejoint/>
    <geom type="box" size="0.1 0.05 0.08" mass="4"/>
    <body name="mount" pos="0.05 0.01 0.1" euler="0 0.5 0"><geom size="0.03" mass="0.4"/>
      <site name="My_IMU" pos="0.02 0 0.01"/><body name="imu_box" pos="1 1 1"/></body>
    <body name="chest" pos="0 0 0.2"><joint name="waist" axis="0 0 1" range="0.2 1"/><geom size="0.1" mass="2"/>
      <body name="arm" pos="0 0.3 0"><joint name="arm" axis="0 1 0" range="0.4 2"/>
        <geom name="hand" size="0.04" pos="0.2 0 0" mass="0.6"/></body>
      {ODD_LEG.format("l", 0.1, 0.4)}{ODD_LEG.format("r", -0.1, -0.3)}</body>
  </body></worldbody></mujoco>"""


class TestMachine:
    """An MJCF in which nothing is where it is easiest: angles at zero, anchors, frames, a shared waist."""

    @pytest.fixture
    def source(self, tmp_path: Path) -> Source:
        return read(tmp_path, ODD)

    @pytest.fixture
    def machine(self, source: Source) -> Machine:
        return build_machine(source, "odd")[0]

    def test_every_link_moves_as_in_the_source(self, source: Source, machine: Machine) -> None:
        """Feet, bricks and the mass matrix, seen from the base; the arm is held at 0.4 rad."""
        theirs, ours = source.model, mujoco.MjModel.from_xml_string(model_xml(machine))
        for seed in range(2):
            rng = np.random.default_rng(seed)
            data = mujoco.MjData(theirs), mujoco.MjData(ours)
            for hinge in machine.hinges:
                angle = rng.uniform(-0.5, 0.5)
                for each in data:
                    each.joint(hinge.name).qpos = angle
            data[0].joint("arm").qpos = 0.4
            bases = theirs.body("pelvis").id, 1
            places, matrices = [], []
            for model, each, base in zip((theirs, ours), data, bases, strict=True):
                mujoco.mj_forward(model, each)
                turn = each.xmat[base].reshape(3, 3)
                kinds = (
                    model.geom_type == Kind.mjGEOM_BOX,
                    np.isin(model.geom_size[:, 0], (0.025, 0.03, 0.04)),
                )
                seen = [(each.geom_xpos[kind] - each.xpos[base]) @ turn for kind in kinds]
                axes = np.abs(turn.T @ each.geom_xmat[kinds[0]].reshape(-1, 3, 3))
                places.append(np.concatenate([*seen, *axes]))
                full = np.zeros((model.nv, model.nv))
                mujoco.mj_fullM(model, each, full)
                dofs = [int(model.joint(hinge.name).dofadr[0]) for hinge in machine.hinges]
                matrices.append(full[np.ix_(dofs, dofs)])
            np.testing.assert_allclose(places[1], places[0], atol=2e-5)
            np.testing.assert_allclose(matrices[1], matrices[0], atol=2e-5)

    def test_a_joint_that_legs_share_is_driven_and_of_no_leg(self, machine: Machine) -> None:
        assert [hinge.name for hinge in machine.hinges][0] == "waist"
        assert [leg.joints for leg in machine.legs] == [
            (f"{s}_roll", f"{s}_pitch", f"{s}_knee") for s in "lr"
        ]

    def test_each_hinge_keeps_its_own_figures(self, machine: Machine) -> None:
        hinges = {hinge.name: hinge for hinge in machine.hinges}
        roll, knee = hinges["r_roll"], hinges["l_knee"]
        assert (roll.low, roll.high, roll.zero, roll.damping, roll.friction) == (-0.6, 0.9, 0.3, 0.3, 0.0)
        assert (knee.low, knee.high, knee.zero, hinges["r_pitch"].friction) == (-2.0, -0.1, -0.5, 0.4)
        np.testing.assert_allclose(roll.anchor, [0.01, 0.02, -0.03])

    def test_a_foot_keeps_its_friction_and_what_it_collides_with(self, machine: Machine) -> None:
        model = mujoco.MjModel.from_xml_string(model_xml(machine))
        foot = model.geom(machine.legs[1].geoms[0])
        assert (foot.friction[0], foot.contype[0], foot.conaffinity[0]) == (1.3, 2, 5)
        assert (foot.priority[0], foot.condim[0]) == (1, 3)

    def test_the_imu_is_at_the_site_as_the_base_sees_it(self, machine: Machine) -> None:
        """0.05 m ahead and 0.1 m up, and 0.02 and 0.01 m along axes that are turned by 0.5 rad about y."""
        along = 0.02 * np.cos(0.5) + 0.01 * np.sin(0.5), 0.01 * np.cos(0.5) - 0.02 * np.sin(0.5)
        np.testing.assert_allclose(machine.imu, [0.05 + along[0], 0.01, 0.1 + along[1]], atol=1e-9)

    def test_what_is_named_imu_on_a_limb_is_none(self, tmp_path: Path) -> None:
        text = ODD.replace("My_IMU", "mark").replace('<body name="imu_box" pos="1 1 1"/>', "")
        machine, guesses = build_machine(
            read(tmp_path, text.replace('name="l_bracket"', 'name="l_imu"')), "odd"
        )
        assert not machine.imu.any()
        assert any("IMU: at the origin of 'pelvis'" in guess for guess in guesses)

    def test_only_joints_of_the_robot_that_lead_to_no_foot_are_said_to_be_rigid(self, source: Source) -> None:
        _, guesses = build_machine(source, "odd")
        assert [guess for guess in guesses if "rigid" in guess] == [
            "joints that lead to no foot are rigid, as near to zero as they go: arm"
        ]

    def test_a_feather_keeps_its_inertia_and_a_machine_its_height(self, machine: Machine) -> None:
        light = replace(machine.links[-1], inertia=np.diag([3e-7, 4e-7, 5e-7]) + 1e-8 * (1 - np.eye(3)))
        feather = replace(machine, links=(*machine.links[:-1], light))
        model = mujoco.MjModel.from_xml_string(model_xml(feather, 0.75, notes=["a --feet b"]))
        axes = rotation_of(model.body_iquat[-1])
        np.testing.assert_allclose(axes @ np.diag(model.body_inertia[-1]) @ axes.T, light.inertia, atol=2e-9)
        assert model.body_pos[1].tolist() == [0.0, 0.0, 0.75]

    @pytest.mark.parametrize("extra", ['<geom size="0.01" mass="0"/>', '<body name="b"><joint axis="1 0 0" range="-1 1"/>'
                                       '<geom name="b_foot" size="0.02" pos="0 0.1 -0.4" mass="0.1"/></body>'])  # fmt: skip
    def test_a_link_without_mass_that_touches_or_carries_two_is_refused(
        self, tmp_path: Path, extra: str
    ) -> None:
        light = """<body name="light"><joint axis="1 0 0" range="-1 1"/><inertial pos="0 0 0" mass="1e-9"
          diaginertia="1e-9 1e-9 1e-9"/>{}{}</body>"""
        text = on_base(light.format(hanging("a_foot", 0.1, 0.4), extra), hanging("c_foot", -0.1, 0.4))
        with pytest.raises(UserError, match="light moves and has no mass"):
            build_machine(read(tmp_path, text), "x")

    def test_links_that_come_after_one_without_mass_keep_their_parents(self, tmp_path: Path) -> None:
        light = """<body name="light" pos="0 0.1 0" euler="0.3 0 0"><joint name="first" axis="1 0 0" range="-1 1"/>
          <inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>{}</body>"""
        shin = hanging("c_foot", 0.0, 0.4).replace('pos="0 0.0 0"', 'pos="0 0 -0.2"')
        text = on_base(light.format(hanging("a_foot", 0.05, 0.6)), hanging("c", -0.1, 0.2, shin))
        machine, _ = build_machine(read(tmp_path, text), "x")
        assert [(link.name, link.parent) for link in machine.links] == [
            ("base", -1), ("a_foot", 0), ("c", 0), ("c_foot", 2)
        ]  # fmt: skip
        assert [hinge.name for hinge in machine.links[1].hinges] == ["first", "a_foot_joint"]


# -- what the files say ------------------------------------------------------------------------------


class TestMjcf:
    @pytest.mark.parametrize(
        ("actuators", "joint", "expected"),
        [
            ('<motor joint="a_joint" gear="-8" ctrlrange="-1 2"/>', "", {"a_joint": 16.0}),
            ('<general joint="a_joint" gear="2" gainprm="3" ctrlrange="-4 1"/>', "", {"a_joint": 24.0}),
            ('<position joint="a_joint" kp="9" ctrlrange="-1 1"/>', "", {}),
            ('<position joint="a_joint" kp="9" gear="3" forcerange="-5 7"/>', "", {"a_joint": 21.0}),
            (2 * '<motor joint="b_joint" ctrlrange="-6 6"/>', "", {"b_joint": 12.0}),
            ('<motor joint="b_joint" ctrlrange="-6 6"/><motor joint="b_joint"/>', "", {}),
            ('<motor joint="a_joint" ctrlrange="-6 6"/>', 'actuatorfrcrange="-3 4"', {"a_joint": 4.0}),
            ('<motor joint="a_joint" ctrlrange="-2 2"/>', 'actuatorfrcrange="-3 4"', {"a_joint": 2.0}),
            ('<motor site="a_site" ctrlrange="-6 6"/>', "", {}),
        ],
    )
    def test_a_joints_torque_is_all_that_its_actuators_give_within_its_limit(
        self, tmp_path: Path, actuators: str, joint: str, expected: dict[str, float]
    ) -> None:
        first = hanging("a", 0.1, 0.2, '<site name="s"/><site name="a_site"/>').replace(
            "range=", f"{joint} range="
        )
        text = on_base(first, hanging("b", -0.1, 0.2), extra=f"<actuator>{actuators}</actuator>")
        found = read(tmp_path, text).peak_torque_nm
        assert found == pytest.approx(expected)

    @pytest.mark.parametrize(
        ("names", "knee"), [(("run", "my_Home"), 0.2), (("run", "walk"), 0.1), (("stand", "home"), 0.1)]
    )
    def test_the_pose_is_of_the_key_that_stands_or_of_the_first(
        self, tmp_path: Path, names: tuple[str, str], knee: float
    ) -> None:
        keys = "".join(
            f'<key name="{name}" qpos="0 0 1 1 0 0 0 {angle} {-angle}"/>'
            for name, angle in zip(names, (0.1, 0.2), strict=True)
        )
        text = on_base(hanging("a", 0.1, 0.2), hanging("b", -0.1, 0.2), extra=f"<keyframe>{keys}</keyframe>")
        assert read(tmp_path, text).pose_rad == {"a_joint": knee, "b_joint": -knee}

    def test_a_mesh_is_where_its_geom_has_it(self, tmp_path: Path) -> None:
        """A wedge moved by its own figures and turned by a quarter about z: (x, y) becomes (-y, x)."""
        mesh = '<asset><mesh name="wedge" vertex="0.1 0 0  0.4 0 0  0.1 0.2 0  0.1 0 0.3"/></asset>'
        shoe = f'<geom type="mesh" mesh="wedge" pos="1 2 3" quat="{np.sqrt(0.5)} 0 0 {np.sqrt(0.5)}"/>'
        source = read(tmp_path, on_base(hanging("a", 0.1, 0.2, shoe), hanging("b", -0.1, 0.2), extra=mesh))
        points = next(iter(source.meshes.values()))
        np.testing.assert_allclose(points.min(axis=0), [0.8, 2.1, 3.0], atol=1e-6)
        np.testing.assert_allclose(points.max(axis=0), [1.0, 2.4, 3.3], atol=1e-6)

    def test_what_has_no_name_is_given_one_and_a_tree_with_joints_floats(self, tmp_path: Path) -> None:
        text = on_base(hanging("a", 0.1, 0.2), hanging("b", -0.1, 0.2)).replace("<freejoint/>", "")
        text = text.replace('name="a_joint"', "").replace('name="b_joint"', 'name="floating_base"')
        source = read(tmp_path, text.replace("<worldbody>", '<worldbody><body><geom size="1"/></body>'))
        names = [source.model.joint(joint).name for joint in range(source.model.njnt)]
        assert sorted(names) == ["a_joint", "floating_base", "floating_base1"]
        assert source.model.jnt_bodyid[source.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE].tolist() == [
            source.model.body("base").id
        ]
        assert all(source.model.geom(geom).name for geom in range(source.model.ngeom))


class TestUrdf:
    CUBE = (
        "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.2) for z in (0, 0.3))
        + "f 1 2 3\nf 6 7 8\n"
    )

    def source(self, tmp_path: Path, mesh: str, origin: str = "", **packages: Any) -> Source:
        foot = f"<collision>{origin}<geometry><mesh {mesh}/></geometry></collision>"
        (tmp_path / "robot").mkdir(exist_ok=True)
        (tmp_path / "robot/m.urdf").write_text(quadruped(foot=foot))
        return read_source(tmp_path / "robot/m.urdf", **packages)

    def test_a_mesh_is_scaled_turned_about_fixed_axes_and_moved(self, tmp_path: Path) -> None:
        (tmp_path / "c.obj").write_text(self.CUBE)
        origin = '<origin rpy="0.3 -0.5 0.9" xyz="1 2 3"/>'
        source = self.source(tmp_path, f'filename="file://{tmp_path}/c.obj" scale="1 -2 0.5"', origin)
        corners = np.array([[x, y, z] for x in (0, 0.1) for y in (0, -0.4) for z in (0, 0.15)])
        wanted = Rotation.from_euler("xyz", [0.3, -0.5, 0.9]).apply(corners) + [1, 2, 3]
        found = next(iter(source.meshes.values()))
        np.testing.assert_allclose(
            sorted(found.round(6).tolist()), sorted(wanted.round(6).tolist()), atol=2e-6
        )

    def test_one_file_in_two_sizes_is_two_shapes(self, tmp_path: Path) -> None:
        (tmp_path / "c.obj").write_text(self.CUBE)
        text = quadruped(
            foot='<collision><geometry><mesh filename="c.obj" scale="1 1 1"/></geometry></collision>'
        )
        head, found, tail = text.rpartition('scale="1 1 1"')
        (tmp_path / "m.urdf").write_text(f'{head}scale="3 1 1"{tail}')
        assert found
        sizes = [points[:, 0].max() for points in read_source(tmp_path / "m.urdf").meshes.values()]
        assert sizes == pytest.approx([0.1, 0.1, 0.1, 0.3])

    def test_packages_are_looked_for_as_asked_then_above_the_file_then_where_ros_has_them(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        asked, ros = tmp_path / "asked", tmp_path / "ros/elsewhere"
        monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{ros}")
        places = (ros / "maker", tmp_path / "maker", asked / "maker")
        for size, folder in enumerate(places, start=1):
            folder.mkdir(parents=True)
            (folder / "c.obj").write_text(self.CUBE.replace("v 0.1", f"v {size}"))
            source = self.source(tmp_path, 'filename="package://maker/c.obj"', packages=(asked,))
            assert next(iter(source.meshes.values()))[:, 0].max() == pytest.approx(size)
        (asked / "c.obj").write_text(self.CUBE.replace("v 0.1", "v 9"))
        source = self.source(tmp_path, 'filename="package://other/c.obj"', packages=(asked,))
        assert next(iter(source.meshes.values()))[:, 0].max() == pytest.approx(9.0)

    def test_effort_and_velocity_count_where_they_are_above_zero(self, tmp_path: Path) -> None:
        source = read(
            tmp_path, quadruped(knee_limit='<limit lower="-2" upper="-1" effort="7" velocity="0"/>'), "urdf"
        )
        assert (source.peak_torque_nm["FL_knee"], source.peak_torque_nm["FL_roll"]) == (7.0, 21.0)
        assert "FL_knee" not in source.speed_rad_s
        assert source.speed_rad_s["RR_hip"] == 16.0

    def test_without_collisions_what_is_seen_is_taken_and_with_one_it_is_not(self, tmp_path: Path) -> None:
        visual = '<visual><origin xyz="0 0 -0.2"/><geometry><sphere radius="0.03"/></geometry></visual>'
        some = read(tmp_path, quadruped(thigh=visual), "urdf")
        assert 0.03 not in some.model.geom_size[:, 0]
        only = quadruped(foot=visual).replace("collision>", "visual>")
        none = read(tmp_path, only, "urdf")
        assert (none.model.geom_size[:, 0] == 0.03).sum() == 4
        assert none.guesses == ("no link has a collision geometry: the visual ones were taken",)
        assert some.guesses == ()
        with pytest.raises(UserError, match="no link has a collision or visual geometry"):
            read(tmp_path, '<robot name="r"><link name="a"/></robot>', "urdf")

    def test_a_continuous_joint_turns_half_a_turn_either_way(self, tmp_path: Path) -> None:
        source = read(
            tmp_path, quadruped(knee_kind="continuous", knee_limit='<limit effort="3" velocity="7"/>'), "urdf"
        )
        np.testing.assert_allclose(source.model.joint("RL_knee").range, [-np.pi, np.pi])

    def test_an_inertia_that_no_body_has_is_raised_to_a_radius_of_a_millimetre(self, tmp_path: Path) -> None:
        """0.4 kg on an arm: 4e-7 kg m^2 about its thinnest axis, the others as they are."""
        moments = 'ixx="0.0016" iyy="0.002" izz="0.0012000000000000001" ixy="0.00016" ixz="0.0" iyz="0.0"'
        text = quadruped()
        assert moments in text
        flat = 'ixx="0.002" iyy="0.001" izz="0" ixy="0" ixz="0" iyz="0"'
        source = read(tmp_path, text.replace(moments, flat), "urdf")
        assert source.guesses == ("inertias that no body has were evened out: arm_link",)
        assert read(tmp_path, text, "urdf").guesses == ()
        weightless = text.replace('<mass value="0.4"/>', '<mass value="0"/>')
        assert read(tmp_path, weightless, "urdf").model.body("arm_link").mass[0] < 1e-6


class TestMeshFiles:
    def test_a_collada_scene_of_nested_nodes(self, tmp_path: Path) -> None:
        """The inner node's points doubled along x and moved by (1, 0, 0), then all a quarter turn about z."""
        (tmp_path / "a.DAE").write_text(
            """<COLLADA><library_geometries><geometry id="g"><mesh>
            <source id="normals"><float_array>9 9 9</float_array></source>
            <source id="p"><float_array>1 2 3 4 5 6</float_array></source>
            <vertices id="v"><input semantic="POSITION" source="#p"/></vertices></mesh></geometry>
            </library_geometries><library_visual_scenes><visual_scene>
            <node><matrix>0 -1 0 0 1 0 0 0 0 0 1 0 0 0 0 1</matrix>
            <node><translate>1 0 0</translate><scale>2 1 1</scale><instance_geometry url="#g"/></node></node>
            </visual_scene></library_visual_scenes></COLLADA>"""
        )
        points = read_points(tmp_path / "a.DAE", np.array([1.0, 1.0, 10.0]))
        np.testing.assert_allclose(points, [[-2, 3, 30], [-5, 9, 60]])

    def test_a_binary_stl_may_begin_as_one_of_text_does(self, tmp_path: Path) -> None:
        corners = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype="<f4")
        faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
        body = b"".join(
            np.concatenate([np.zeros(3), *corners[list(face)]]).astype("<f4").tobytes() + b"\0\0"
            for face in faces
        )
        (tmp_path / "a.stl").write_bytes(
            b"solid by a tool".ljust(80) + len(faces).to_bytes(4, "little") + body
        )
        points = read_points(tmp_path / "a.stl", np.array([1.0, 1.0, 2.0]))
        assert sorted({tuple(p) for p in points.round(5).tolist()}) == [
            (0, 0, 0),
            (0, 0, 6),
            (0, 2, 0),
            (1, 0, 0),
        ]

    @pytest.mark.parametrize(
        "vertices", ["vertex 1 2 nan\nvertex 1 2 3\n", "vertex 1 2 3\n", "vertex a b c\n"]
    )
    def test_what_holds_no_points_is_refused(self, tmp_path: Path, vertices: str) -> None:
        (tmp_path / "a.stl").write_text(f"solid a\nfacet\n{vertices}")
        with pytest.raises(UserError, match="mesh"):
            read_points(tmp_path / "a.stl", np.ones(3))


# -- motors and gains --------------------------------------------------------------------------------


def rod_machine(torque_free: Sequence[Hinge], legs: tuple[Leg, ...] = ()) -> Machine:
    """A base of 5 kg and a link of 3 kg with some hinges."""
    link = Link("link", 0, np.zeros(3), LEVEL, 3.0, np.zeros(3), np.eye(3), tuple(torque_free), ())
    base = Link("base", -1, np.zeros(3), LEVEL, 5.0, np.zeros(3), np.eye(3), (), ())
    return Machine("m", (base, link), legs, np.zeros(3))


def hinge(name: str, span: float = 2.0, armature: float = 0.01, friction: float = 0.0) -> Hinge:
    return Hinge(
        name, np.array([0.0, 1.0, 0.0]), np.zeros(3), -0.25 * span, 0.75 * span, 0.0, armature, 0.0, friction
    )


def source_of(tmp_path: Path, peak: dict[str, float], speed: dict[str, float] | None = None) -> Source:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    return Source(tmp_path / "m.urdf", model, False, {}, peak, speed or {})


CALM = Statics(np.zeros(3), np.zeros((0, 0)), np.zeros((3, 0)))  # no weight, nothing to tip


class TestDrive:
    HINGES = hinge("a", 0.5), hinge("b"), hinge("c")

    def drive(self, tmp_path: Path, hinges: Sequence[Hinge], torque: Sequence[float], statics: Statics = CALM,
              wished: dict[str, float] | None = None, speed: dict[str, float] | None = None) -> Drive:  # fmt: skip
        machine = rod_machine(hinges)
        peak = {each.name: value for each, value in zip(hinges, torque, strict=True)}
        return choose_drive(machine, source_of(tmp_path, peak, speed), peak, wished or {}, statics)

    def test_the_middle_joint_asks_for_its_peak_torque_at_three_quarters_of_a_radian(
        self, tmp_path: Path
    ) -> None:
        """20 N m over 0.01 kg m^2 and 0.75 rad: 51.6 rad/s, 8.2 Hz, of which steps of a half begin at 8."""
        drive = self.drive(tmp_path, self.HINGES, (10.0, 20.0, 90.0))
        assert (drive.natural_frequency_hz, drive.stands) == (8.0, True)

    def test_an_action_moves_no_joint_by_more_than_nine_tenths_of_its_range(self, tmp_path: Path) -> None:
        """kp = 0.01 (2 pi 8)^2 = 25.27 N m/rad; of 0.5 rad and 90 N m that is a share of 0.1263."""
        tight = self.drive(tmp_path, (hinge("a"), hinge("b"), hinge("c", 0.5)), (10.0, 20.0, 90.0))
        assert tight.torque_share == 0.126
        assert self.drive(tmp_path, self.HINGES, (10.0, 20.0, 20.0)).torque_share == 0.3

    def test_stiffness_is_twice_the_least_that_keeps_it_from_tipping(self, tmp_path: Path) -> None:
        """One motion of the second joint, from which gravity takes 10 N m/rad: 20 N m/rad at 7.12 Hz."""
        tipping = Statics(np.zeros(3), np.array([[-10.0]]), np.array([[0.0], [1.0], [0.0]]))
        drive = self.drive(tmp_path, self.HINGES, (1.0, 1.0, 1.0), tipping)
        assert drive.natural_frequency_hz == 7.5
        assert any("7.5 Hz, at which it should stand" in guess for guess in drive.guesses)

    def test_where_nothing_lets_it_stand_the_usual_stiffness_is_taken_and_told(self, tmp_path: Path) -> None:
        tipping = Statics(np.zeros(3), np.array([[-1e9]]), np.array([[0.0], [1.0], [0.0]]))
        drive = self.drive(tmp_path, self.HINGES, (10.0, 20.0, 90.0), tipping)
        assert (drive.natural_frequency_hz, drive.stands) == (8.0, False)
        assert any("no stiffness of the joints lets it stand" in guess for guess in drive.guesses)

    def test_friction_is_ramped_so_that_the_plants_steps_can_follow(self, tmp_path: Path) -> None:
        """3 N m in a step of 1 ms takes 0.3 rad/s of 0.01 kg m^2: three tenths of 1 rad/s."""
        hinges = hinge("a", friction=3.0), hinge("b", friction=0.1), hinge("c", armature=0.04, friction=3.0)
        motors = self.drive(tmp_path, hinges, (20.0, 20.0, 20.0)).motors
        assert [motors[name].friction_speed_rad_s for name in "abc"] == pytest.approx([1.0, 0.2, 0.25])

    def test_speeds_are_as_wished_else_the_files_if_a_motor_has_such(self, tmp_path: Path) -> None:
        drive = self.drive(
            tmp_path, self.HINGES, (20.0,) * 3, wished={"a": 12.0}, speed={"a": 3.0, "b": 59.0, "c": 61.0}
        )
        assert [drive.motors[name].no_load_speed_rad_s for name in "abc"] == [12.0, 59.0, 30.0]
        assert [guess for guess in drive.guesses if "no-load speed of" in guess] == [
            "no-load speed of c: 30 rad/s"
        ]
        unsaid = self.drive(tmp_path, self.HINGES, (20.0,) * 3)
        assert [motor.no_load_speed_rad_s for motor in unsaid.motors.values()] == [30.0] * 3

    def test_that_a_file_says_nothing_of_friction_is_told(self, tmp_path: Path) -> None:
        told = "friction and damping of the joints: none, as the file says nothing"
        assert told in self.drive(tmp_path, self.HINGES, (20.0,) * 3).guesses
        said = hinge("a", friction=0.1), *self.HINGES[1:]
        assert told not in self.drive(tmp_path, said, (20.0,) * 3).guesses

    @pytest.mark.parametrize(("torque", "taken"), [(94.0, True), (95.0, False)])
    def test_a_files_torque_is_at_most_three_times_the_weight_on_the_leg(
        self, tmp_path: Path, torque: float, taken: bool
    ) -> None:
        """8 kg * 9.81 m/s^2 * 0.4 m * 3 = 94.2 N m; what the user says is not doubted."""
        machine = rod_machine(self.HINGES)
        source = source_of(tmp_path, {"a": 10.0, "b": torque, "c": 10.0})
        if taken:
            assert peak_torques(machine, source, {}, 0.4)["b"] == torque
        else:
            with pytest.raises(UserError, match="joint b has a peak torque of 95 N m, which is no motor's"):
                peak_torques(machine, source, {}, 0.4)
        assert peak_torques(machine, source, {"b": 200.0, "": 5.0}, 0.4) == {"a": 5.0, "b": 200.0, "c": 5.0}
        bare = source_of(tmp_path, {"a": 10.0, "c": 10.0})
        assert peak_torques(machine, bare, {"b": 200.0}, 0.4)["b"] == 200.0
        with pytest.raises(UserError, match=r"joint b has no peak torque \(effort\)"):
            peak_torques(machine, bare, {}, 0.4)


class Carries(NamedTuple):
    """What a made-up motor's frames carry."""

    torque: float
    velocity: float = 50.0
    kp: float = 500.0
    kd: float = 5.0


class TestRobotYaml:
    def chosen(self, armature: float = 0.01, **known: Carries) -> tuple[dict[str, str], list[str]]:
        """For a motor of 20 N m and 30 rad/s at 8 Hz, critically damped: kp 25.3, kd 1.005."""
        machine = rod_machine([hinge("a", armature=armature)])
        drive = Drive({"a": JointMotor(20.0, 30.0, 0.2)}, 8.0, 0.3, True, ())
        return choose_protocols(machine, drive, known)

    @pytest.mark.parametrize(
        "lacking",
        [Carries(19.9), Carries(20.0, velocity=29.0), Carries(20.0, kp=25.0), Carries(20.0, kd=1.0)],
    )
    def test_a_joint_gets_the_weakest_motor_whose_frames_carry_all_that_it_needs(
        self, lacking: Carries
    ) -> None:
        chosen = self.chosen(a=Carries(90.0), b=lacking, c=Carries(25.0, kp=25.3, kd=1.01))
        assert chosen == ({"a": "c"}, [])
        assert self.chosen(a=lacking, b=Carries(18.0)) == ({"a": "a"}, ["a"])

    def text(self, legs: int = 2, hinges: int = 9) -> list[str]:
        names = [f"j{k}" for k in range(hinges)]
        own = tuple(Leg(f"leg {k}", tuple(names[1 + 4 * k : 5 + 4 * k]), 1, (f"g{k}",)) for k in range(legs))
        machine = rod_machine([hinge(name) for name in names], own)
        motors = {name: JointMotor(20.0 + (name == "j2"), 30.0 + k, 0.25) for k, name in enumerate(names)}
        pose = Pose(dict.fromkeys(names, 0.12346), 0.34567, 0.0, 0.5)
        return robot_yaml(
            machine, pose, Drive(motors, 8.0, 0.3, True, ()), dict.fromkeys(names, "AK"), []
        ).splitlines()

    def test_each_leg_has_buses_of_its_own_of_three_motors_each(self) -> None:
        joints = [line for line in self.text() if "default_rad" in line]
        places = [line.partition("bus: ")[2].rstrip("}") for line in joints]
        assert places == [
            "can0, id: 1",
            *("can1, id: 1", "can1, id: 2", "can1, id: 3", "can2, id: 1"),
            *("can3, id: 1", "can3, id: 2", "can3, id: 3", "can4, id: 1"),
        ]
        assert "default_rad: 0.1235," in joints[0]

    @pytest.mark.parametrize(
        ("legs", "commands"),
        [
            (2, "commands: {forward_m_s: [-0.6, 0.6], leftward_m_s: [-0.3, 0.3], yaw_rad_s: [-0.6, 0.6]}"),
            (3, "commands: {forward_m_s: [-1.0, 1.0], leftward_m_s: [-0.5, 0.5], yaw_rad_s: [-1.0, 1.0]}"),
        ],
    )
    def test_commands_are_shares_of_the_speed_at_which_legs_of_half_a_metre_fall(
        self, legs: int, commands: str
    ) -> None:
        """sqrt(9.81 * 0.5) = 2.21 m/s: a quarter of it on two legs, 0.45 on more; half as much sideways."""
        assert commands in self.text(legs, 13)

    def test_height_speed_and_motors_are_written_down(self) -> None:
        lines = self.text()
        assert any(line.startswith("standing_height_m: 0.3457 ") for line in lines)
        assert any(line.startswith("target_rate_rad_s: 76 ") for line in lines)  # twice the fastest
        assert lines.count("    friction_speed_rad_s: 0.25") == 9
        assert sum(line.startswith("    stall_torque_nm: 20") for line in lines) == 8

    def test_names_that_yaml_would_take_for_something_else_are_quoted(self) -> None:
        machine = replace(rod_machine([hinge("no"), hinge("1e3"), hinge("Off")]), name="y")
        motors = dict.fromkeys(("no", "1e3", "Off"), JointMotor(20.0, 30.0, 0.2))
        pose = Pose(dict.fromkeys(motors, 0.0), 0.3, 0.0, 0.5)
        text = robot_yaml(
            machine, pose, Drive(motors, 8.0, 0.3, True, ()), dict.fromkeys(motors, "AK"), ["told"]
        )
        content = yaml.safe_load(text)
        assert content["name"] == "y"
        assert [joint["name"] for joint in content["joints"]] == ["no", "1e3", "Off"]
        assert text.startswith("# told\n")


# -- poses -------------------------------------------------------------------------------------------


def walker(*, knee: str = "-2 -0.4", more: str = "", legs: Sequence[tuple[str, float, float]] = ()) -> str:
    """Legs of two links of 0.2 m with balls of 0.02 m, hips at the height of the base's origin."""
    places = legs or (("fl", 0.2, 0.1), ("fr", 0.2, -0.1), ("rl", -0.2, 0.1), ("rr", -0.2, -0.1))
    limbs = "".join(
        f"""<body name="{name}_thigh" pos="{x} {y} 0">
          <joint name="{name}_roll" axis="1 0 0" range="-0.8 0.8"/>
          <joint name="{name}_hip" axis="0 1 0" range="-2 2"/>
          <geom type="capsule" fromto="0 0 -.03 0 0 -.15" size="0.01" mass="0.2"/>
          <body name="{name}_shank" pos="0 0 -0.2"><joint name="{name}_knee" axis="0 1 0" range="{knee}"/>
            <geom name="{name}_foot" size="0.02" pos="0 0 -0.2" mass="0.05"/></body></body>"""
        for name, x, y in places
    )
    return on_base(limbs, more)


class TestPose:
    def pose(self, tmp_path: Path, text: str) -> Pose:
        return standing_pose(build_machine(read(tmp_path, text), "m")[0])

    def test_four_legs_stand_at_three_quarters_of_their_reach(self, tmp_path: Path) -> None:
        """A knee of -2 to -0.4 rad may use 0.85 of it, to -0.52: 0.4 cos(0.26) m and the ball's radius."""
        pose = self.pose(tmp_path, walker())
        reach = 0.4 * np.cos(0.26) + 0.02
        assert pose.reach_m == pytest.approx(reach, abs=5e-3)
        assert pose.height_m == pytest.approx(0.75 * reach, abs=5e-3)
        assert all(-1.88 <= pose.joints[f"{leg}_knee"] <= -0.52 for leg in ("fl", "fr", "rl", "rr"))

    def test_two_legs_stand_nearly_straight(self, tmp_path: Path) -> None:
        text = walker(legs=(("l", 0.0, 0.1), ("r", 0.0, -0.1)), knee="0.4 2")
        pose = self.pose(tmp_path, text)
        reach = 0.4 * np.cos(0.26) + 0.02
        assert pose.height_m == pytest.approx(0.95 * reach, abs=5e-3)
        assert pose.knees_forward_m > 0.01

    def test_knees_that_may_bend_either_way_bend_backward_on_four_legs(self, tmp_path: Path) -> None:
        pose = self.pose(tmp_path, walker(knee="-2 2"))
        assert pose.knees_forward_m < -0.05
        assert all(pose.joints[f"{leg}_knee"] < -0.5 for leg in ("fl", "fr", "rl", "rr"))

    def test_legs_that_are_alike_stand_alike(self, tmp_path: Path) -> None:
        pose = self.pose(tmp_path, walker(knee="-2 2"))
        for leg, mirrored in (("fr", -1.0), ("rl", 1.0), ("rr", -1.0)):
            expected = [mirrored * pose.joints["fl_roll"], pose.joints["fl_hip"], pose.joints["fl_knee"]]
            assert [pose.joints[f"{leg}_{part}"] for part in ("roll", "hip", "knee")] == pytest.approx(
                expected, abs=1e-12
            )

    def test_feet_move_under_a_load_that_is_ahead_and_to_one_side(self, tmp_path: Path) -> None:
        load = '<geom type="box" size="0.02 0.02 0.02" pos="0.25 0.12 0.1" mass="2"/>'
        machine, _ = build_machine(read(tmp_path, walker(more=load)), "m")
        pose = standing_pose(machine)
        model = mujoco.MjModel.from_xml_string(model_xml(machine))
        data = mujoco.MjData(model)
        for name, angle in pose.joints.items():
            data.joint(name).qpos = angle
        mujoco.mj_forward(model, data)
        feet = np.mean([data.geom(leg.geoms[0]).xpos for leg in machine.legs], axis=0)
        np.testing.assert_allclose(data.subtree_com[1][:2], feet[:2], atol=4e-3)
        assert data.subtree_com[1][0] - data.xpos[1][0] > 0.05
        assert data.subtree_com[1][1] - data.xpos[1][1] > 0.02

    def test_joints_of_no_leg_are_as_near_to_zero_as_they_go(self, tmp_path: Path) -> None:
        """A waist that both legs of a biped hang on."""
        pose = self.pose(tmp_path, ODD)
        assert pose.joints["waist"] == pytest.approx(0.2)

    def test_a_given_pose_is_kept_within_94_hundredths_of_each_range(self, tmp_path: Path) -> None:
        machine, _ = build_machine(read(tmp_path, walker()), "m")
        given = {each.name: 0.3 for each in machine.hinges} | {"rl_knee": -3.0, "fr_knee": -1.0}
        pose = standing_pose(machine, given)
        assert (pose.joints["fl_hip"], pose.joints["fr_knee"]) == pytest.approx((0.3, -1.0))
        assert pose.joints["rl_knee"] == pytest.approx(-1.2 - 0.94 * 0.8)
        assert pose.joints["fl_knee"] == pytest.approx(-1.2 + 0.94 * 0.8)

    def searches(self, tmp_path: Path, text: str) -> tuple[mujoco.MjModel, mujoco.MjData, list[_LegSearch]]:
        machine, _ = build_machine(read(tmp_path, text), "m")
        model = mujoco.MjModel.from_xml_string(model_xml(machine))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        return model, data, [_LegSearch(model, data, leg) for leg in machine.legs]

    @pytest.mark.parametrize(("other", "across"), [(1, -1.0), (2, 1.0), (3, -1.0)])
    def test_a_leg_stands_like_another_or_like_its_mirror_image(
        self, tmp_path: Path, other: int, across: float
    ) -> None:
        """Also where hinges count the other way, and have other angles where their links are as in the file."""
        text = walker()
        for name in ("fr", "rl"):
            text = text.replace(f'"{name}_hip" axis="0 1 0"', f'"{name}_hip" axis="0 -1 0" ref="0.4"')
        model, data, legs = self.searches(tmp_path, text)
        angles = legs[0].zero + [0.3, -0.5, -0.9]
        data.qpos[legs[0].at], data.qpos[legs[other].at] = angles, legs[other].like(legs[0], angles)
        mujoco.mj_kinematics(model, data)
        first, second = (leg.foot(data) - [*leg.hip[:2], 0.0] for leg in (legs[0], legs[other]))
        np.testing.assert_allclose(second, first * [1.0, across, 1.0], atol=1e-6)

    def test_a_foot_belongs_below_where_it_is_at_zero_nearer_for_a_leg_that_is_spread(
        self, tmp_path: Path
    ) -> None:
        """0.4 m long: one that reaches 0.1 m down of it is spread, and stands at 0.7 of its 0.3 m."""

        def spread(name: str, y: float, down: float) -> str:
            return f"""<body name="{name}" pos="0.1 {y} 0"><joint name="{name}_hip" axis="0 0 1" range="-1 1"/>
              <geom name="{name}_foot" size="0.02" pos="0 {np.sign(y) * np.sqrt(0.16 - down**2)} {-down}" mass="0.1"/></body>"""

        _, _, legs = self.searches(tmp_path, on_base(spread("a", 0.1, 0.1), spread("b", -0.1, 0.2)))
        aside = np.sqrt(0.16 - 0.1**2)
        np.testing.assert_allclose(legs[0].natural_place(), [0.1, 0.1 + 0.7 * aside], atol=1e-5)
        np.testing.assert_allclose(legs[1].natural_place(), [0.1, -0.1 - np.sqrt(0.12)], atol=1e-5)

    def test_what_stands_on_three_balls_off_a_line_is_a_sole(self, tmp_path: Path) -> None:
        def feet(*places: tuple[float, float]) -> str:
            return "".join(f'<geom size="0.01" pos="{x} {y} -0.3" mass="0.01"/>' for x, y in places)

        limbs = [
            hanging("a_foot", 0.3, 0.01, feet((0.1, 0.0), (-0.1, 0.03), (-0.1, -0.03))),
            hanging("b_foot", 0.0, 0.01, feet((0.1, 0.0), (0.0, 0.0), (-0.1, 0.0))),
            hanging("c_foot", -0.3, 0.01, feet((0.1, 0.0), (-0.1, 0.03))),
        ]
        _, _, legs = self.searches(tmp_path, on_base(*limbs))
        assert [leg.sole for leg in legs] == [True, False, False]

    def test_a_turned_ellipsoid_is_as_low_as_its_surface(self) -> None:
        model = mujoco.MjModel.from_xml_string(
            '<mujoco><worldbody><geom type="ellipsoid" size="0.03 0.06 0.1" pos="0 0 1" euler="40 20 0"/>'
            "</worldbody></mujoco>"
        )
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        points = surface(Kind.mjGEOM_ELLIPSOID, (0.03, 0.06, 0.1)) @ data.geom_xmat[0].reshape(3, 3).T
        assert lowest_height(model, data, 0) == pytest.approx(1.0 + points[:, 2].min(), abs=1e-4)

    def test_a_sole_is_set_down_level_and_pointing_ahead(self, tmp_path: Path) -> None:
        """The biped's, of six joints to a leg."""
        machine, _ = build_machine(read(tmp_path, BIPED_MJCF), "m")
        pose = standing_pose(machine)
        model = mujoco.MjModel.from_xml_string(model_xml(machine))
        data = mujoco.MjData(model)
        for name, angle in pose.joints.items():
            data.joint(name).qpos = angle
        mujoco.mj_kinematics(model, data)
        for leg in machine.legs:
            axes = data.body(machine.links[leg.link].name).xmat.reshape(3, 3)
            np.testing.assert_allclose(axes, np.eye(3), atol=0.03)


# -- statics -----------------------------------------------------------------------------------------


class TestStatics:
    """10 kg on two legs that swing sideways about hips 0.1 m off the middle; feet 0.05 m farther out."""

    def found(self, centre: tuple[float, float, float], weight: float = 0.0) -> Statics:
        legs = "".join(
            f"""<body name="{name}" pos="0 {0.1 * side} 0"><joint name="{name}" axis="1 0 0"/>
              <geom name="{name}0" size="0.01" pos="0.1 {0.05 * side} -0.49" mass="{1e-6 + weight}"/>
              <geom name="{name}1" size="0.01" pos="-0.1 {0.05 * side} -0.49" mass="{1e-6 + weight}"/></body>"""
            for name, side in (("left", 1.0), ("right", -1.0))
        )
        text = f"""<mujoco><worldbody><body pos="0 0 9"><joint name="extra" type="free"/>
          <geom size="0.1" pos="{centre[0]} {centre[1]} {centre[2]}" mass="10"/>{legs}</body></worldbody></mujoco>"""
        model = mujoco.MjModel.from_xml_string(text)
        own = tuple(Leg(name, (name,), 1, (f"{name}0", f"{name}1")) for name in ("left", "right"))
        return statics(model, ("left", "right"), own, model.qpos0)

    @pytest.mark.parametrize(("aside", "left"), [(0.0, 0.5), (0.03, 0.6), (-0.06, 0.3)])
    def test_each_leg_carries_as_much_as_balances_the_weight_about_both_axes(
        self, aside: float, left: float
    ) -> None:
        """Of feet at 0.15 and -0.15 m the left one bears (0.15 + y) / 0.3 of 98.1 N, 0.05 m from its hip."""
        torque = self.found((0.02, aside, 0.1)).torque_nm
        assert torque == pytest.approx([-0.05 * 98.1 * left, 0.05 * 98.1 * (1 - left)], abs=1e-3)

    def test_the_legs_own_weight_hangs_on_their_hips(self) -> None:
        """1 kg in each foot lies on the ground: the hips carry what they did without it."""
        torque = self.found((0.0, 0.0, 0.1), weight=0.5).torque_nm
        assert torque == pytest.approx([-0.05 * 49.05, 0.05 * 49.05], abs=1e-3)


# -- the folder --------------------------------------------------------------------------------------


class TestCreate:
    def request(self, tmp_path: Path, folder: str = "made", **wishes: Any) -> ImportRequest:
        (tmp_path / "m.urdf").write_text(quadruped())
        return ImportRequest(tmp_path / "m.urdf", tmp_path / folder, RANGES, **wishes)

    def test_the_folder_may_lie_in_others_that_are_not_there_and_names_the_robot(
        self, tmp_path: Path
    ) -> None:
        made = import_robot(self.request(tmp_path, "new/deep/my dog-2_x"))
        assert made.folder == tmp_path / "new/deep/my dog-2_x"
        assert load_robot(made.folder).name == "my_dog-2_x"
        assert [path.name for path in made.folder.parent.iterdir()] == ["my dog-2_x"]

    @pytest.mark.parametrize("wish", ["peak_torque_nm", "speed_rad_s", "armature"])
    def test_a_wish_for_a_joint_that_there_is_not_is_refused(self, tmp_path: Path, wish: str) -> None:
        with pytest.raises(UserError, match="no joint has 'wrist' in its name"):
            import_robot(self.request(tmp_path, **{wish: {"wrist": 3.0}}))
        assert not (tmp_path / "made").exists()

    def test_a_link_to_nowhere_is_a_folder_that_exists(self, tmp_path: Path) -> None:
        (tmp_path / "made").symlink_to(tmp_path / "nowhere")
        with pytest.raises(UserError, match="exists already"):
            import_robot(self.request(tmp_path))

    def test_what_cannot_be_loaded_is_not_left_behind(self, tmp_path: Path) -> None:
        """Joints of so much damping that the plant's steps cannot follow it."""
        request = self.request(tmp_path)
        request.source.write_text(quadruped().replace('damping="0.1', 'damping="900.1'))
        with pytest.raises(UserError, match="too much for its inertia"):
            import_robot(request)
        assert [path.name for path in tmp_path.iterdir()] == ["m.urdf"]

    def test_torques_that_no_frame_carries_are_told_of(self, tmp_path: Path) -> None:
        made = import_robot(self.request(tmp_path, peak_torque_nm={"FL_knee": 900.0}))
        assert "no protocol here carries what FL_knee can do: the widest was taken" in made.guesses
        plain = import_robot(self.request(tmp_path, "plain"))
        assert not any("no protocol here" in guess or "pairs of links" in guess for guess in plain.guesses)
        assert plain.guesses[0] == "base: 'trunk', its x axis pointing forward, z up"
        assert any(guess.startswith("gains: a natural frequency") for guess in plain.guesses)
