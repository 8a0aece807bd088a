"""Mirror images of joints, feet, bodies and quantities."""

from pathlib import Path

import numpy as np
import pytest
from edited import edit
from scipy.spatial.transform import Rotation

from footfall import Robot, UserError, load_robot
from footfall.robots import kinds
from footfall.robots.symmetry import Mirror, Symmetry, find_symmetry

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
        assert kind.size(kinds.Parts(joints=3, bodies=5, feet=4)) == len(value)
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


def test_a_part_without_a_mirror_image_is_named(own_folder: Path) -> None:
    calf = "RR_calf_joint,  motor: knee, default_rad: "
    for file, old, new, named in (
        ("robot.xml", 'name="FL_hip" pos="0.1881 ', 'name="FL_hip" pos="0.2081 ', "_joint"),
        ("robot.xml", '"FL_calf_joint"', '"FL_calf_joint" axis="0.2 1 0"', "FR_calf"),
        ("robot.xml", '"FL_foot" class="foot"/>', '"FL_foot" class="foot" pos="0.02 0 -.213"/>', "foot F"),
        ("robot.xml", 'mass="5.204" pos="0.0223 0.002', 'mass="5.204" pos="0.0223 0.02', "trunk"),
        # Two milliradians move no joint by the tolerance on places.
        ("robot.yaml", f"{calf}-1.8", f"{calf}-1.802", "pose"),
    ):
        text = (own_folder / file).read_text()
        edit(own_folder, file, old, new)
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
