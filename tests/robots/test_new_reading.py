"""What `footfall robot new` reads: limbs, links, and what the files say of meshes and motors, by hand."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from foreign_robots import ODD, hanging, on_base, quadruped, read
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.limbs import FOOT_NAME, find_limbs
from footfall.robots.importer.machine import Machine
from footfall.robots.importer.meshes import read_points
from footfall.robots.importer.model_xml import model_xml
from footfall.robots.importer.read import read_source
from footfall.robots.importer.shapes import (
    Kind,
    rotation_of,
)
from footfall.robots.importer.source import Source


def feet_of(source: Source, *named: str) -> list[str]:
    limbs = find_limbs(source, named)
    return [source.model.body(leg.bodies[0]).name for leg in limbs.legs]


class TestLimbs:
    @pytest.mark.parametrize(
        ("name", "called"),
        [
            *((name, True) for name in ("FL_foot", "toe_2", "l_toes", "Paw1", "Sole", "feet")),
            *((name, False) for name in ("stoel", "tow_hook", "shank")),
        ],
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
            (
                'name="b_joint" axis="0 1 0" range="-1 1"',
                'name="b_joint" axis="0 1 0"',
                "of a leg has no limits",
            ),
            ('name="b_joint" axis="0 1 0"', 'name="b_joint" type="slide"', "is a slide joint"),
            (
                "</mujoco>",
                '<equality><joint joint1="b_joint" joint2="a_joint"/></equality></mujoco>',
                "b_joint of a leg follows another one",
            ),
            (
                "</mujoco>",
                '<equality><weld name="w" body1="a" body2="b"/></equality></mujoco>',
                "equality w closes a loop",
            ),
            ('pos="0 -0.1 0"', 'pos="0 -0.1 0.19"', "only one foot, a, found"),
        ],
    )
    def test_what_cannot_be_driven_is_named(self, tmp_path: Path, old: str, new: str, says: str) -> None:
        text = on_base(hanging("a", 0.1, 0.2), hanging("b", -0.1, 0.2))
        assert old in text
        with pytest.raises(UserError, match=says):
            find_limbs(read(tmp_path, text.replace(old, new)))

    def test_a_loop_that_is_switched_off_closes_nothing(self, tmp_path: Path) -> None:
        loop = '<equality><weld body1="a" body2="b" active="false"/></equality>'
        source = read(tmp_path, on_base(hanging("a", 0.1, 0.2), hanging("b", -0.1, 0.2), extra=loop))
        assert feet_of(source) == ["a", "b"]


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
        assert machine.hinges[0].name == "waist"
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
        model = mujoco.MjModel.from_xml_string(model_xml(feather, 0.75))
        axes = rotation_of(model.body_iquat[-1])
        np.testing.assert_allclose(axes @ np.diag(model.body_inertia[-1]) @ axes.T, light.inertia, atol=2e-9)
        assert model.body_pos[1].tolist() == [0.0, 0.0, 0.75]
        assert (model.opt.cone, model.opt.impratio) == (mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0)
        ET.fromstring(model_xml(machine, notes=["no comment of XML may hold --"]))

    @pytest.mark.parametrize(
        "extra",
        [
            '<geom size="0.01" mass="0"/>',
            """<body name="b"><joint axis="1 0 0" range="-1 1"/>
              <geom name="b_foot" size="0.02" pos="0 0.1 -0.4" mass="0.1"/></body>""",
        ],
    )
    def test_a_link_without_mass_that_touches_or_carries_two_is_refused(
        self, tmp_path: Path, extra: str
    ) -> None:
        light = """<body name="light"><joint axis="1 0 0" range="-1 1"/><inertial pos="0 0 0" mass="1e-9"
          diaginertia="1e-9 1e-9 1e-9"/>{}{}</body>"""
        text = on_base(light.format(hanging("a_foot", 0.1, 0.4), extra), hanging("c_foot", -0.1, 0.4))
        with pytest.raises(UserError, match="light moves and has no mass"):
            build_machine(read(tmp_path, text), "x")

    def test_links_that_come_after_one_without_mass_keep_their_parents(self, tmp_path: Path) -> None:
        light = """<body name="light" pos="0 0.1 0" euler="0.3 0 0">
          <joint name="first" axis="1 0 0" range="-1 1"/>
          <inertial pos="0 0 0" mass="1e-9" diaginertia="1e-9 1e-9 1e-9"/>{}</body>"""
        shin = hanging("c_foot", 0.0, 0.4).replace('pos="0 0.0 0"', 'pos="0 0 -0.2"')
        text = on_base(light.format(hanging("a_foot", 0.05, 0.6)), hanging("c", -0.1, 0.2, shin))
        machine, _ = build_machine(read(tmp_path, text), "x")
        assert [(link.name, link.parent) for link in machine.links] == [
            ("base", -1), ("a_foot", 0), ("c", 0), ("c_foot", 2)
        ]  # fmt: skip
        assert [hinge.name for hinge in machine.links[1].hinges] == ["first", "a_foot_joint"]


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
        wanted = Rotation.from_euler("xyz", [0.3, -0.5, 0.9]).apply(corners) + np.array([1, 2, 3])
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
