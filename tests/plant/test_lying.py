"""A robot lies, stands up and lies down again in simulation; a missing lying pose is found."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from changed_robots import described
from foreign_robots import BIPED_MJCF, make, quadruped

from footfall.deploy.config import DeployConfig
from footfall.plant.lying import find_lying_pose, lying_test, resting_effort
from footfall.robots.description import Robot

QUICK = DeployConfig(joint_rate_hz=250.0, stand_s=0.2, pose_rate_rad_s=3.0, stop_rate_rad_s=3.0, stop_s=0.1)


FOLDS = '<limit lower="-2.7" upper="-0.4" effort="23" velocity="17"/>'  # of a knee


def lying_in(robot: Robot, pose: list[float | None]) -> Robot:
    joints = zip(robot.description.joints, pose, strict=True)
    return described(robot, joints=tuple(replace(joint, lying_rad=angle) for joint, angle in joints))


def quickly(robot: Robot) -> np.ndarray | None:
    return find_lying_pose(robot, QUICK)


def test_go1_stands_up_and_lies_down_again(go1: Robot) -> None:
    found = lying_test(go1, config=QUICK)
    assert found.trouble == ""
    assert abs(found.clearance_m) < 0.005
    assert 0.0 < found.tilt_rad < 0.15


def test_a_robot_on_its_feet_does_not_lie(go1: Robot) -> None:
    crouched = lying_in(go1, [0.0, 1.2, -2.2] * 4)
    assert lying_test(crouched, config=QUICK).trouble
    assert resting_effort(go1, go1.default_pose) == np.inf


def test_a_pose_is_found_in_which_go1_rests_on_its_trunk(go1: Robot) -> None:
    pose = quickly(lying_in(go1, [None] * 12))
    assert pose is not None
    lower, upper = go1.soft_limits
    assert ((pose > lower) & (pose < upper)).all()
    legs = go1.legs
    assert (legs.pose(pose).foot[:, 2] - legs.foot_radius) == pytest.approx(-legs.base_below, abs=0.002)
    folded = pose.reshape(4, 3)
    np.testing.assert_allclose(np.abs(folded), np.abs(folded[[0]]).repeat(4, axis=0), atol=1e-3)


def test_another_makers_quadruped_gets_a_lying_pose(tmp_path: Path) -> None:
    robot = make(tmp_path, quadruped(knee_limit=FOLDS), "urdf", find_lying_pose=quickly)[0]
    assert robot.lying_pose is not None
    assert "- lying pose: legs folded" in (robot.folder / "robot.yaml").read_text()


@pytest.mark.parametrize(("text", "suffix"), [(BIPED_MJCF, "xml"), (quadruped(), "urdf")])
def test_a_robot_that_tips_or_hardly_folds_gets_no_lying_pose(tmp_path: Path, text: str, suffix: str) -> None:
    robot = make(tmp_path, text, suffix, find_lying_pose=quickly)[0]
    assert robot.lying_pose is None
    assert "- no lying pose: " in (robot.folder / "robot.yaml").read_text()
