"""Torques, pose, meshes and names read from an MJCF."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from foreign_robots import limb, on_base, read


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
def test_a_joints_torque_is_the_sum_over_its_actuators_within_its_own_limit(
    tmp_path: Path, actuators: str, joint: str, expected: dict[str, float]
) -> None:
    first = limb("a", 0.1, 0.2, '<site name="s"/><site name="a_site"/>').replace("range=", f"{joint} range=")
    text = on_base(first, limb("b", -0.1, 0.2), extra=f"<actuator>{actuators}</actuator>")
    assert read(tmp_path, text).peak_torque_nm == pytest.approx(expected)


@pytest.mark.parametrize(
    ("names", "knee"), [(("run", "my_Home"), 0.2), (("run", "walk"), 0.1), (("stand", "home"), 0.1)]
)
def test_the_pose_is_that_of_a_keyframe(tmp_path: Path, names: tuple[str, str], knee: float) -> None:
    keys = "".join(
        f'<key name="{name}" qpos="0 0 1 1 0 0 0 {angle} {-angle}"/>'
        for name, angle in zip(names, (0.1, 0.2), strict=True)
    )
    text = on_base(limb("a", 0.1, 0.2), limb("b", -0.1, 0.2), extra=f"<keyframe>{keys}</keyframe>")
    assert read(tmp_path, text).pose_rad == {"a_joint": knee, "b_joint": -knee}


def test_reserved_keyframes_give_no_pose(tmp_path: Path) -> None:
    """Models of gymnasium and PyBullet reserve keyframes that they do not have."""
    reserved = on_base(limb("a", 0.1, 0.2), limb("b", -0.1, 0.2), extra='<size nkey="5"/>')
    source = read(tmp_path, reserved)
    assert source.model.nkey == 5
    assert source.pose_rad == {}


def test_a_mesh_is_at_its_geoms_position(tmp_path: Path) -> None:
    """A wedge is moved, and turned by a quarter turn about z: (x, y) becomes (-y, x)."""
    mesh = '<asset><mesh name="wedge" vertex="0.1 0 0  0.4 0 0  0.1 0.2 0  0.1 0 0.3"/></asset>'
    shoe = f'<geom type="mesh" mesh="wedge" pos="1 2 3" quat="{np.sqrt(0.5)} 0 0 {np.sqrt(0.5)}"/>'
    source = read(tmp_path, on_base(limb("a", 0.1, 0.2, shoe), limb("b", -0.1, 0.2), extra=mesh))
    points = next(iter(source.meshes.values()))
    np.testing.assert_allclose(points.min(axis=0), [0.8, 2.1, 3.0], atol=1e-6)
    np.testing.assert_allclose(points.max(axis=0), [1.0, 2.4, 3.3], atol=1e-6)


def test_unnamed_parts_get_names_and_the_tree_a_free_joint(tmp_path: Path) -> None:
    text = on_base(limb("a", 0.1, 0.2), limb("b", -0.1, 0.2)).replace("<freejoint/>", "")
    text = text.replace('name="a_joint"', "").replace('name="b_joint"', 'name="floating_base"')
    source = read(tmp_path, text.replace("<worldbody>", '<worldbody><body><geom size="1"/></body>'))
    names = [source.model.joint(joint).name for joint in range(source.model.njnt)]
    assert sorted(names) == ["a_joint", "floating_base", "floating_base1"]
    assert source.model.jnt_bodyid[source.model.jnt_type == mujoco.mjtJoint.mjJNT_FREE].tolist() == [
        source.model.body("base").id
    ]
    assert all(source.model.geom(geom).name for geom in range(source.model.ngeom))
