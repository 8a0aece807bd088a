"""Legs among the limbs of a model."""

from pathlib import Path

import pytest
from foreign_robots import limb, on_base, read

from footfall.common.errors import UserError
from footfall.robots.importer.limbs import FOOT_NAME, find_limbs
from footfall.robots.importer.source import Source


def feet_of(source: Source, *named: str) -> list[str]:
    return [source.model.body(leg.bodies[0]).name for leg in find_limbs(source, named).legs]


def test_names_of_feet_are_recognised() -> None:
    for name in ("FL_foot", "toe_2", "l_toes", "Paw1", "Sole", "feet"):
        assert FOOT_NAME.search(name), name
    for name in ("stoel", "tow_hook", "shank"):
        assert not FOOT_NAME.search(name), name


def test_a_limb_ends_where_no_joint_follows_also_behind_a_fixed_part(tmp_path: Path) -> None:
    def leg(name: str, y: float) -> str:
        shank = limb(f"{name}_shank", 0.0, 0.3)
        return limb(f"{name}_thigh", y, 0.02, f'<body name="{name}_bracket" pos="0 0 -0.2">{shank}</body>')

    source = read(tmp_path, on_base(leg("l", 0.1), leg("r", -0.1)))
    assert feet_of(source) == ["l_shank", "r_shank"]
    assert find_limbs(source).legs[1].joints == ("r_thigh_joint", "r_shank_joint")


def test_a_part_that_is_fixed_to_a_limbs_end_may_have_the_foots_name(tmp_path: Path) -> None:
    toe = '<body name="{}_pad" pos="0 0 -0.2"><geom size="0.01" mass="0.01"/></body>'
    limbs = (limb(name, y, 0.2, toe.format(name)) for name, y in (("a", 0.1), ("b", -0.1)))
    source = read(tmp_path, on_base(*limbs))
    assert feet_of(source, "b_pad", "a") == ["b", "a"]
    assert find_limbs(source, ("b_pad", "a")).guesses == ()
    for named, reason in ((("b_pad", "a", "b"), "'b'"), (("a",), "2 feet")):
        with pytest.raises(UserError, match=reason):
            find_limbs(source, named)
    assert len(find_limbs(source).guesses) == 1


def test_the_base_is_the_free_body_with_the_most_joints(tmp_path: Path) -> None:
    text = on_base(limb("a", 0.1, 0.2), limb("b", -0.1, 0.2))
    crate = '<worldbody><body name="crate"><freejoint/><geom size="1"/></body>'
    source = read(tmp_path, text.replace("<worldbody>", crate))
    assert source.model.body(find_limbs(source).base).name == "base"


def test_an_upper_body_is_refused_unless_its_hands_are_named_as_feet(tmp_path: Path) -> None:
    source = read(tmp_path, on_base(limb("left_gripper", 0.1, 0.2), limb("right_gripper", -0.1, 0.2)))
    with pytest.raises(UserError, match=r"left_gripper, right_gripper, .*--feet"):
        find_limbs(source)
    assert feet_of(source, "left_gripper", "right_gripper") == ["left_gripper", "right_gripper"]


def test_limbs_that_reach_as_low_as_the_named_feet_are_mentioned(tmp_path: Path) -> None:
    feet = limb("left_foot", 0.1, 0.2), limb("right_foot", -0.1, 0.2)
    for length, mentioned in ((0.2, True), (0.1, False)):
        (guess,) = find_limbs(read(tmp_path, on_base(*feet, limb("hand", 0.0, length)))).guesses
        assert ("hand" in guess) == mentioned


def test_joints_that_cannot_be_driven_are_named(tmp_path: Path) -> None:
    text = on_base(limb("a", 0.1, 0.2), limb("b", -0.1, 0.2))
    for old, new, named in (
        ('name="b_joint" axis="0 1 0"', 'name="b_joint" type="slide"', "b_joint .*slide"),
        ("</mujoco>", '<equality><joint joint1="b_joint" joint2="a_joint"/></equality></mujoco>', "b_joint"),
        ("</mujoco>", '<equality><weld name="w" body1="a" body2="b"/></equality></mujoco>', "equality w"),
        ('pos="0 -0.1 0"', 'pos="0 -0.1 0.19"', "foot, a,"),
    ):
        assert old in text
        with pytest.raises(UserError, match=named):
            find_limbs(read(tmp_path, text.replace(old, new)))
