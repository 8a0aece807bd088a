"""The output of `footfall robot` for given figures: descriptions and verdicts."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from changed_robots import described
from recorder import Recorder
from shell import Shell

from footfall import Robot, robot_check
from footfall.domain_rand.randomisation import default_ranges
from footfall.plant.lying import LyingResult, find_lying_pose
from footfall.plant.standing import StandingResult
from footfall.policies.gaits import gaits_of

# A standing test without findings.
STOOD = StandingResult(
    fall_reason="", faults=(), stood_s=4.0, sank_m=0.01, tilt_rad=0.05, moved_m=0.02,
    torque_share=np.linspace(0.1, 0.5, 12), feet_down=np.ones(4),
)  # fmt: skip


def test_findings_of_a_standing_test(go1: Robot) -> None:
    height_m = go1.description.standing_height_m
    assert height_m == 0.2945
    just = {"sank_m": 0.149 * height_m, "tilt_rad": 0.169, "torque_share": np.full(12, 0.8)}
    fell = {"stood_s": 1.25, "sank_m": 0.2, "tilt_rad": 1.0}
    for changes, named in (
        ({}, ""),
        (just | {"feet_down": np.full(4, 0.5)}, ""),
        ({"sank_m": 0.151 * height_m}, "44 mm"),
        ({"tilt_rad": 0.175}, "10 degrees"),
        ({"torque_share": np.where(np.arange(12) == 4, 0.81, 0.1)}, "FL_thigh_joint"),
        ({"feet_down": np.array([1.0, 1.0, 0.49, 1.0])}, "RR"),
        (fell | {"fall_reason": "it tilted", "faults": ("x",)}, "it tilted after 1.2 s"),
        (fell | {"faults": ("motor 3", "motor 4")}, "motor 3; motor 4"),
    ):
        found = list(robot_check.standing_findings(go1, replace(STOOD, **changes)))
        assert len(found) == (1 if named else 0)
        assert named in "".join(found)


def test_gains_beyond_the_frames_range_are_reported_by_joint(go1: Robot) -> None:
    assert list(robot_check.gains_beyond_frames(go1)) == []
    incomplete: Any = SimpleNamespace(description=go1.description, kp=go1.kp[:-1], kd=go1.kd)
    with pytest.raises(ValueError, match="shorter"):  # rather than no finding for the last joint
        list(robot_check.gains_beyond_frames(incomplete))
    for gain, limit in (("kp", 500.0), ("kd", 5.0)):
        gains = {"kp": go1.kp.copy(), "kd": go1.kd.copy()}
        gains[gain][[5, 7]] = limit + 0.5, limit
        robot: Any = SimpleNamespace(description=go1.description, **gains)
        (found,) = robot_check.gains_beyond_frames(robot)
        assert "FL_calf_joint" in found
        assert f"{gain} is {limit + 0.5:.3g}" in found


def test_anything_wrong_is_status_1(shell: Shell, called: Recorder, go1: Robot) -> None:
    """Nothing is simulated. At first every test passes; a robot without a lying pose is not laid down."""
    found: list[str] = []
    figures = {"links": [], "feet": [], "margin_m": 0.1, "mass_kg": 1.0, "centre_m": np.zeros(3)}
    looked = SimpleNamespace(**figures, findings=lambda **_: iter(found))
    called.replace("footfall.robots.inspection.inspect_robot", looked)
    called.replace("footfall.plant.standing.standing_test", STOOD)
    called.replace("footfall.plant.lying.lying_test", LyingResult("", 0.0, 0.1))
    called.replace("footfall.plant.walking.controllers_test", [])
    joints = tuple(replace(joint, lying_rad=None) for joint in go1.description.joints)
    called.replace("footfall.robots.description.load_robot", described(go1, joints=joints))
    outcome = shell("robot", "check", "mine")
    assert "lying_test" not in called.names
    assert (outcome.status, "lying_rad" in outcome.out) == (0, True)
    called.replace("footfall.robots.description.load_robot", go1)
    assert shell("robot", "check", "go1", "--duration", "2.5", "--seed", "9").status == 0
    found.append("a foot is missing")
    outcome = shell("robot", "check", "go1")
    assert (outcome.status, "a foot is missing" in outcome.out) == (1, True)
    found.clear()
    called.replace("footfall.plant.lying.lying_test", LyingResult("it fell over", 0.0, 1.5))
    outcome = shell("robot", "check", "go1")
    assert (outcome.status, "it fell over" in outcome.out) == (1, True)


def test_options_reach_the_import(shell: Shell, called: Recorder, go1: Robot) -> None:
    made = SimpleNamespace(folder="there", guesses=["a guess", "another"])
    called.replace("footfall.robots.importer.create.import_robot", made)
    called.replace("footfall.robots.description.load_robot", go1)
    outcome = shell(
        "robot", "new", "--from", "a.urdf", "--out", "mine", "--feet", "left,right", "--packages", "p", "q",
        "--peak-torque", "23.7", "--speed", "hip=30.1, knee=20.06", "--armature", "a=b=0.01",
        "--forward=-y", "--up", "z", "--actuator", "hip=A, knee=B",
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    ((request,), _) = called.of("import_robot")
    assert (request.source, request.folder) == (Path("a.urdf"), Path("mine"))
    assert (request.feet, request.packages) == (("left", "right"), (Path("p"), Path("q")))
    assert (request.forward, request.up) == ("-y", "z")
    assert request.actuators == {"hip": "A", "knee": "B"}
    assert request.peak_torque_nm == {"": 23.7}
    assert request.speed_rad_s == {"hip": 30.1, "knee": 20.06}
    assert request.armature == {"a=b": 0.01}
    assert (request.gaits_of, request.find_lying_pose) == (gaits_of, find_lying_pose)
    assert request.defaults == default_ranges()
    assert {"- a guess", "- another"} <= set(outcome.out.splitlines())


def test_a_figure_of_a_new_robot_is_a_number_above_zero(shell: Shell) -> None:
    new = ("robot", "new", "--from", "a.urdf", "--out", "b")
    for value in ("0", "-1", "1e6", "hip=", "hip=x", "=,", "nan", "inf", "hip=1,knee=0"):
        assert "--speed" in shell.refuses(*new, f"--speed={value}")
