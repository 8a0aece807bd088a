"""Mirror images of joints, feet, bodies and quantities."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.policies.gaits import find_gait
from footfall.robots import kinds
from footfall.robots.description import Robot, load_robot
from footfall.robots.kinds import Parts
from footfall.robots.symmetry import Mirror, Symmetry, find_symmetry

PARTS = Parts(joints=3, bodies=5, feet=4)
SYMMETRY = Symmetry(
    joints=Mirror(np.array([1, 0, 2]), np.array([1.0, 1.0, -1.0])),
    feet=np.array([1, 0, 3, 2]),
    bodies=np.array([0, 2, 1, 4, 3]),
    clock=-1.0,
)
MIRROR = np.diag([1.0, -1.0, 1.0])  # at the x-z plane


def test_each_kind_has_its_size_and_image() -> None:
    for kind, value, image in (
        (kinds.SCALAR, [7.0], [7.0]),
        (kinds.VECTOR, [1.0, 2.0, 3.0], [1.0, -2.0, 3.0]),
        (kinds.ROTATION, [1.0, 2.0, 3.0], [-1.0, 2.0, -3.0]),
        (kinds.COMMAND, [1.0, 2.0, 3.0], [1.0, -2.0, -3.0]),
        (kinds.CLOCK, [3.0, 4.0], [-3.0, -4.0]),
        (kinds.JOINTS, [1.0, 2.0, 3.0], [2.0, 1.0, -3.0]),
        (kinds.JOINT_AMOUNTS, [1.0, 2.0, 3.0], [2.0, 1.0, 3.0]),
        (kinds.BODY_AMOUNTS, [1.0, 2.0, 3.0, 4.0, 5.0], [1.0, 3.0, 2.0, 5.0, 4.0]),
        (kinds.FOOT_AMOUNTS, [1.0, 2.0, 3.0, 4.0], [2.0, 1.0, 4.0, 3.0]),
    ):
        assert kind.size(PARTS) == len(value)
        mirrored = kind.mirror(SYMMETRY)(np.array([value, np.multiply(value, 10.0)], dtype=np.float32))
        np.testing.assert_array_equal(mirrored, [image, np.multiply(image, 10.0)])
        assert mirrored.dtype == np.float32
    together = SYMMETRY._replace(clock=1.0)  # partners that step together
    assert kinds.CLOCK.mirror(together)(np.array([3.0, 4.0])).tolist() == [3.0, 4.0]


def test_rotations_are_mirrored_as_the_motion_is() -> None:
    """A small turn r x p of a point, seen in the mirror, is the mirrored turn of the mirrored point."""
    turn, point = np.array([0.3, -0.5, 0.7]), np.array([1.1, 0.4, -0.8])
    image = kinds.ROTATION.mirror(SYMMETRY)(turn)
    np.testing.assert_allclose(np.cross(image, MIRROR @ point), MIRROR @ np.cross(turn, point), atol=1e-12)
    turned = Rotation.from_rotvec(turn).as_matrix()
    np.testing.assert_allclose(Rotation.from_rotvec(image).as_matrix(), MIRROR @ turned @ MIRROR, atol=1e-12)


def test_partners_and_signs_of_go1(go1: Robot) -> None:
    """Legs are listed right, left, right, left; hips turn about x, thighs and calves about y."""
    found = find_symmetry(go1)
    assert found.feet.tolist() == [1, 0, 3, 2]
    assert found.joints.source.tolist() == [3, 4, 5, 0, 1, 2, 9, 10, 11, 6, 7, 8]
    assert found.joints.sign.tolist() == [-1, 1, 1] * 4
    assert found.bodies.tolist() == [0, 4, 5, 6, 1, 2, 3, 10, 11, 12, 7, 8, 9]
    assert set(np.abs(found.joints.sign)) == {1.0}


def test_a_trunk_with_an_initial_rotation_is_still_symmetric(own_folder: Path, go1: Robot) -> None:
    xml = own_folder / "robot.xml"
    xml.write_text(
        xml.read_text().replace('"trunk" pos="0 0 0.445"', '"trunk" pos="1 2 0.4" euler="0.1 0.2 1.3"')
    )
    found, expected = find_symmetry(load_robot(own_folder)), find_symmetry(go1)
    for ours, theirs in zip(found, expected, strict=True):
        np.testing.assert_array_equal(np.ravel(ours), np.ravel(theirs))


def test_a_reversed_axis_changes_the_sign(own_folder: Path, go1: Robot) -> None:
    """Left thighs have the opposite sign: the mirror images of their partners change sign."""
    xml = own_folder / "robot.xml"
    text = xml.read_text()
    for leg in ("FL", "RL"):
        text = text.replace(
            f'name="{leg}_thigh_joint" class="hip"',
            f'name="{leg}_thigh_joint" class="hip" axis="0 -1 0" range="-4.501 0.686"',
        )
    xml.write_text(text)
    declaration = own_folder / "robot.yaml"
    content = yaml.safe_load(declaration.read_text())
    for joint in content["joints"]:
        if joint["name"] in ("FL_thigh_joint", "RL_thigh_joint"):
            joint["default_rad"] *= -1.0
            joint["lying_rad"] *= -1.0
    declaration.write_text(yaml.safe_dump(content))
    assert find_symmetry(load_robot(own_folder)).joints.sign.tolist() == [-1, -1, 1] * 4


def test_a_part_without_a_mirror_image_is_named(own_folder: Path) -> None:
    for file, old, new, named in (
        ("robot.xml", 'name="FL_hip" pos="0.1881 ', 'name="FL_hip" pos="0.2081 ', "_joint"),
        (
            "robot.xml",
            '"FL_calf_joint" class="knee"',
            '"FL_calf_joint" class="knee" axis="0.2 1 0"',
            "FR_calf",
        ),
        ("robot.xml", '"FL_foot" class="foot"/>', '"FL_foot" class="foot" pos="0.02 0 -.213"/>', "foot F"),
        ("robot.xml", 'mass="5.204" pos="0.0223 0.002', 'mass="5.204" pos="0.0223 0.02', "trunk"),
        # Two milliradians move no joint by the tolerance on places.
        (
            "robot.yaml",
            "RR_calf_joint,  motor: knee, default_rad: -1.8",
            "RR_calf_joint, motor: knee, default_rad: -1.802",
            "pose",
        ),
    ):
        text = (own_folder / file).read_text()
        assert old in text
        (own_folder / file).write_text(text.replace(old, new))
        with pytest.raises(UserError, match=f"'go1'.*{named}"):
            find_symmetry(load_robot(own_folder))
        (own_folder / file).write_text(text)


def test_the_clocks_sign_changes_where_partners_step_in_turn(go1: Robot) -> None:
    for phase, sign in (
        (None, 1.0),
        (np.array([0.1, 0.6, 0.85, 0.35]), -1.0),  # half a cycle apart
        (np.array([0.9, 0.9, 0.2, 0.2]), 1.0),  # together
    ):
        assert find_symmetry(go1, phase).clock == sign
    with pytest.raises(UserError, match="go1"):
        find_symmetry(go1, np.array([0.0, 0.5, 0.25, 0.25]))


@pytest.mark.parametrize("name", ["tripod", "ripple", "wave"])
def test_the_mirror_image_of_the_hexapods_gaits_is_half_a_cycle_later(name: str) -> None:
    robot = load_robot("hexapod")
    symmetry = find_symmetry(robot, find_gait(name, robot).phase)
    assert symmetry.clock == -1.0
    feet = [foot.name for foot in robot.description.feet]
    assert [feet[k] for k in symmetry.feet] == ["RF", "RM", "RR", "LF", "LM", "LR"]
