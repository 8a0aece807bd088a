"""Tests of a robot in simulation: it stands, walks, lies down; a missing lying pose is found."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
import yaml
from changed_robots import described
from foreign_robots import BIPED_MJCF, make, quadruped
from scipy.spatial.transform import Rotation
from shell import Shell

from footfall.deploy.config import DeployConfig
from footfall.plant import standing
from footfall.plant.lying import find_lying_pose, lying_test, resting_effort
from footfall.plant.standing import StandingResult, standing_test
from footfall.plant.walking import controllers_test
from footfall.robots.description import Robot, load_robot

QUICK = DeployConfig(joint_rate_hz=250.0, stand_s=0.2, pose_rate_rad_s=3.0, stop_rate_rad_s=3.0, stop_s=0.1)
FOLDS = '<limit lower="-2.7" upper="-0.4" effort="23" velocity="17"/>'  # of a knee
quickly = partial(find_lying_pose, config=QUICK)


def stood(monkeypatch: pytest.MonkeyPatch, robot: Robot, **changes: Any) -> tuple[StandingResult, Any]:
    """The result of four samples, and the requested episode. The second half counts as settled."""
    height = robot.description.standing_height_m
    turns = Rotation.from_euler("xyz", [[0, 0, 0], [0.3, 0, 2.0], [0, -0.1, 0], [0, 0, 0]])
    torque = np.zeros((4, 12))
    torque[:, 0], torque[:, 1] = (-20.0, 1.0, -6.0, 3.0), (9.0, 9.0, 2.0, 4.0)
    facts = {
        "time_s": np.arange(4) / 100.0,
        "base_position": np.add([5, 7, height], [[0, 0, 0], [0.3, 0.4, -0.05], [0, 0, 0.2], [0, 0, 0]]),
        "base_quaternion": turns.as_quat(scalar_first=True),
        "foot_contact": np.array([[0, 0, 0, 0], [0, 0, 0, 0], [1, 1, 0, 1], [1, 0, 0, 1]], dtype=bool),
        "motor_torque": torque,
        **{"fall_reason": "", "fell": False, "faults": (), "walked_s": 0.04},
    }
    run_episode = Mock(return_value=SimpleNamespace(**facts | changes))
    monkeypatch.setattr(standing, "run_episode", run_episode)
    return standing_test(robot, duration_s=2.5, seed=9), run_episode.call_args.args[2]


@pytest.fixture
def strong(go1: Robot) -> Robot:
    """go1 with motors that stall at more than their current limit allows."""
    motor = go1.motor._replace(peak_torque=np.full(12, 10.0), stall_torque=np.full(12, 40.0))
    return replace(go1, motor=motor)


def test_sinking_and_tilt_are_those_of_all_samples_torques_and_contacts_those_after_settling(
    monkeypatch: pytest.MonkeyPatch, strong: Robot
) -> None:
    found, episode = stood(monkeypatch, strong)
    assert (found.sank_m, found.tilt_rad, found.moved_m) == pytest.approx((0.05, 0.3, 0.5))
    assert found.torque_share[:3] == pytest.approx([0.6, 0.4, 0.0])
    assert found.feet_down.tolist() == [1.0, 0.5, 0.0, 1.0]
    assert (found.stood_s, episode.duration_s, episode.seed) == (0.04, 2.5, 9)
    assert not np.any(episode.command_source(1.0))


@pytest.mark.parametrize(
    ("changes", "reason", "is_up"),
    [
        ({}, "", True),
        ({"fall_reason": "it lies down", "fell": True}, "it lies down", False),
        ({"fell": True}, "the simulation diverged", False),
        ({"faults": ("no reply",)}, "", False),
    ],
)
def test_a_robot_stood_if_it_neither_fell_nor_had_a_fault(
    monkeypatch: pytest.MonkeyPatch, strong: Robot, changes: dict, reason: str, is_up: bool
) -> None:
    found, _ = stood(monkeypatch, strong, **changes)
    assert (found.fall_reason, found.stood) == (reason, is_up)


def with_controllers(folder: Path, **sections: dict) -> Robot:
    """The robot of a folder with these settings of its controllers alone."""
    (folder / "controllers.yaml").write_text(yaml.safe_dump(sections, sort_keys=False))
    return load_robot(folder)


@pytest.fixture
def own(go1: Robot) -> dict[str, dict]:
    """Settings of go1's controllers."""
    return yaml.safe_load((go1.folder / "controllers.yaml").read_text())


def test_each_controller_stands_and_walks_or_the_reason_is_named(own_folder: Path, own: dict) -> None:
    crawl = own["trot"] | {"step": own["trot"]["step"] | {"length_m": 0.03}}
    pace, unchanged = own["trot"] | {"kp": 3.0}, {name: own[name] for name in ("stand", "mpc")}
    robot = with_controllers(own_folder, **unchanged, trot=crawl, pace=pace)
    stand, mpc, trot, pace = controllers_test(robot, 2.0)
    assert (stand.outcome, stand.command_m_s, stand.trouble) == ("stands", 0.0, "")
    assert (mpc.outcome, mpc.command_m_s) == ("walks", 0.5)
    assert mpc.speed_m_s == pytest.approx(0.5, abs=0.1)
    assert not trot.trouble
    assert trot.outcome.startswith("walks slowly")
    assert pace.trouble
    assert pace.trace is not None
    assert pace.trace.fell


def test_a_controller_that_refuses_its_settings_fails_alone(
    own_folder: Path, own: dict, shell: Shell
) -> None:
    wrong = {"mpc": own["mpc"] | {"rate_hz": 1e30}, "trot": own["trot"] | {"unheard_of": 1}}
    file = own_folder / "robot.yaml"
    file.write_text(re.sub(r"lying_rad: \S+ +", "", file.read_text()))  # its test takes seconds
    robot = with_controllers(own_folder, **wrong, stand=own["stand"])
    outcome = shell("robot", "check", robot.folder, "--duration", "0.5", "--picture", robot.folder / "p.jpg")
    assert (outcome.status, outcome.err) == (1, "")
    assert re.search(r"^stand +0\.00 .* stands$", outcome.out, re.MULTILINE)
    mpc, trot = [line for line in outcome.out.splitlines() if line.startswith("wrong: ")]
    assert "rate_hz" in mpc
    assert "unheard_of" in trot
    assert (robot.folder / "p.jpg").is_file()


def test_an_unknown_controller_is_refused_before_anything_is_simulated(
    own_folder: Path, shell: Shell
) -> None:
    assert "'trott'" in shell.refuses("robot", "check", with_controllers(own_folder, trott={}).folder)


def lying_in(robot: Robot, pose: list[float | None]) -> Robot:
    joints = zip(robot.description.joints, pose, strict=True)
    return described(robot, joints=tuple(replace(joint, lying_rad=angle) for joint, angle in joints))


def test_go1_stands_up_and_lies_down_again_and_a_robot_on_its_feet_does_not_lie(go1: Robot) -> None:
    found = lying_test(go1, config=QUICK)
    assert found.trouble == ""
    assert abs(found.clearance_m) < 0.005
    assert 0.0 < found.tilt_rad < 0.15
    assert lying_test(lying_in(go1, [0.0, 1.2, -2.2] * 4), config=QUICK).trouble
    assert resting_effort(go1, go1.default_pose) == np.inf


def test_a_pose_is_found_in_which_go1_rests_on_its_trunk(go1: Robot) -> None:
    pose = quickly(lying_in(go1, [None] * 12))
    assert pose is not None
    lower, upper = go1.soft_limits
    assert ((pose > lower) & (pose < upper)).all()
    legs = go1.legs
    assert (legs.pose(pose).foot[:, 2] - legs.foot_radius) == pytest.approx(-legs.base_below, abs=0.002)
    folded = np.abs(pose.reshape(4, 3))
    np.testing.assert_allclose(folded, np.tile(folded[0], (4, 1)), atol=1e-3)


@pytest.mark.parametrize(
    ("text", "folds"), [(quadruped(knee_limit=FOLDS), True), (quadruped(), False), (BIPED_MJCF, False)]
)
def test_another_makers_robot_gets_a_lying_pose_unless_it_tips_or_hardly_folds(
    tmp_path: Path, text: str, folds: bool
) -> None:
    robot = make(tmp_path, text, find_lying_pose=quickly)[0]
    assert (robot.lying_pose is not None) == folds
    remark = "- lying pose: legs folded" if folds else "- no lying pose: "
    assert remark in (robot.folder / "robot.yaml").read_text()
