"""The default pose of an imported robot, and the pairs of capsules that collide in training."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from foreign_robots import UNUSUAL, make, on_base, read

from footfall.robots.importer.build import build_machine
from footfall.robots.importer.leg_pairs import with_leg_pairs
from footfall.robots.importer.machine import Machine
from footfall.robots.importer.model_xml import model_xml
from footfall.robots.importer.pose import LegSearch, standing_pose
from footfall.robots.importer.shapes import Kind
from footfall.robots.model import training_model

# Hips are 0.15 m apart across and 0.9 m along the robot; legs are 0.4 m long.
LONG = (("fl", 0.45, 0.075), ("fr", 0.45, -0.075), ("rl", -0.45, 0.075), ("rr", -0.45, -0.075))


def walker(*hips: tuple[str, float, float], thigh: str = "-2 2", knee: str = "-2 -0.4") -> str:
    """A robot with legs of two links of 0.2 m: a shank with a radius of 1 cm ends in a sphere of 2 cm.

    The hips are at the height of the base's origin; without them they are the corners of a square.
    """
    square = (("fl", 0.2, 0.1), ("fr", 0.2, -0.1), ("rl", -0.2, 0.1), ("rr", -0.2, -0.1))
    return on_base(
        *(
            f"""<body name="{name}_thigh" pos="{x} {y} 0">
              <joint name="{name}_roll" axis="1 0 0" range="-0.8 0.8"/>
              <joint name="{name}_hip" axis="0 1 0" range="{thigh}"/>
              <geom type="capsule" fromto="0 0 -.03 0 0 -.15" size="0.01" mass="0.2"/>
              <body name="{name}_shank" pos="0 0 -0.2">
                <joint name="{name}_knee" axis="0 1 0" range="{knee}"/>
                <geom type="capsule" fromto="0 0 -.02 0 0 -.17" size="0.01" mass="0.05"/>
                <geom name="{name}_foot" size="0.02" pos="0 0 -0.2" mass="0.05"/></body></body>"""
            for name, x, y in hips or square
        )
    )


def machine_of(tmp_path: Path, text: str) -> Machine:
    return build_machine(read(tmp_path, text), "m")[0]


def test_a_given_pose_that_folds_the_legs_is_not_taken(tmp_path: Path) -> None:
    machine = machine_of(tmp_path, walker(knee="-3 -0.4"))
    given = {each.name: 0.0 for each in machine.hinges}
    folded = standing_pose(machine, given | {name: -2.6 for name in given if "knee" in name})
    assert not folded.given
    assert folded == standing_pose(machine)


def test_joints_outside_legs_are_as_near_to_zero_as_possible(tmp_path: Path) -> None:
    """Both legs of the biped hang on a waist."""
    assert standing_pose(machine_of(tmp_path, UNUSUAL)).joints["waist"] == pytest.approx(0.2)


def test_a_given_pose_is_kept_within_94_hundredths_of_each_range(tmp_path: Path) -> None:
    machine = machine_of(tmp_path, walker())
    given = {each.name: 0.3 for each in machine.hinges} | {"rl_knee": -3.0, "fr_knee": -1.0}
    pose = standing_pose(machine, given)
    assert (pose.joints["fl_hip"], pose.joints["fr_knee"]) == pytest.approx((0.3, -1.0))
    assert pose.joints["rl_knee"] == pytest.approx(-1.2 - 0.94 * 0.8)
    assert pose.joints["fl_knee"] == pytest.approx(-1.2 + 0.94 * 0.8)


def searches(tmp_path: Path, text: str) -> tuple[mujoco.MjModel, mujoco.MjData, list[LegSearch]]:
    machine = machine_of(tmp_path, text)
    model = mujoco.MjModel.from_xml_string(model_xml(machine))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return model, data, [LegSearch(model, data, leg) for leg in machine.legs]


@pytest.mark.parametrize(("other", "across"), [(1, -1.0), (2, 1.0), (3, -1.0)])
def test_a_legs_pose_equals_another_legs_or_its_mirror_image(
    tmp_path: Path, other: int, across: float
) -> None:
    """The hinges may have the opposite direction and another zero."""
    text = walker()
    for name in ("fr", "rl"):
        text = text.replace(f'"{name}_hip" axis="0 1 0"', f'"{name}_hip" axis="0 -1 0" ref="0.4"')
    model, data, legs = searches(tmp_path, text)
    angles = legs[0].zero + np.array([0.3, -0.5, -0.9])
    data.qpos[legs[0].at], data.qpos[legs[other].at] = angles, legs[other].like(legs[0], angles)
    mujoco.mj_kinematics(model, data)
    first, second = (leg.foot(data) - [*leg.hip[:2], 0.0] for leg in (legs[0], legs[other]))
    np.testing.assert_allclose(second, first * [1.0, across, 1.0], atol=1e-6)


def test_a_foot_stands_below_its_position_at_zero_and_a_spread_leg_closer(tmp_path: Path) -> None:
    """A leg 0.4 m long that reaches 0.1 m down is spread. Its foot stands at 0.7 of the 0.3 m."""

    def spread(name: str, y: float, down: float) -> str:
        aside = np.sign(y) * np.sqrt(0.16 - down**2)
        return f"""<body name="{name}" pos="0.1 {y} 0">
          <joint name="{name}_hip" axis="0 0 1" range="-1 1"/>
          <geom name="{name}_foot" size="0.02" pos="0 {aside} {-down}" mass="0.1"/></body>"""

    _, _, legs = searches(tmp_path, on_base(spread("a", 0.1, 0.1), spread("b", -0.1, 0.2)))
    aside = np.sqrt(0.16 - 0.1**2)
    np.testing.assert_allclose(legs[0].natural_position(), [0.1, 0.1 + 0.7 * aside], atol=1e-5)
    np.testing.assert_allclose(legs[1].natural_position(), [0.1, -0.1 - np.sqrt(0.12)], atol=1e-5)


def test_only_legs_that_can_touch_each_other_are_paired_and_no_more_pairs_than_capsules(
    tmp_path: Path,
) -> None:
    """Eight legs close to each other on a small base make 28 pairs."""
    eight = ((f"{side}{k}", 0.14 * (k - 1.5), y) for side, y in (("l", 0.06), ("r", -0.06)) for k in range(4))
    far, near = (
        with_leg_pairs(machine, standing_pose(machine), 0).pairs
        for machine in (machine_of(tmp_path, walker(*hips, thigh="-0.5 2")) for hips in (LONG, eight))
    )
    assert {frozenset(pair) for pair in far} == {
        frozenset({"fl_shank", "fr_shank"}),
        frozenset({"rl_shank", "rr_shank"}),
    }
    assert len(near) == 8


def test_an_imported_robot_trains_with_its_pairs_which_touch_only_each_other(tmp_path: Path) -> None:
    robot, imported = make(tmp_path, walker(*LONG, thigh="-0.5 2"), peak_torque_nm={"": 20.0})
    model = training_model(robot)
    assert model.npair == 2
    assert set(model.pair_dim.tolist()) == {1}
    capsules = [*model.pair_geom1, *model.pair_geom2]
    assert set(model.geom_type[capsules].tolist()) == {int(Kind.mjGEOM_CAPSULE)}
    text = robot.xml_path.read_text()
    assert 'class="leg"' in text
    assert '<geom group="3" contype="0" conaffinity="0"/>' in text
    (note,) = (guess for guess in imported.guesses if "collide in training" in guess)
    assert note == (
        "legs collide in training through 2 pairs of capsules, each costs training time:"
        " rl_shank with rr_shank, fl_shank with fr_shank"
    )
    assert note in (robot.folder / "robot.yaml").read_text().replace("\n# ", " ")
