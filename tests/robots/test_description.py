"""Refusals of load_robot in one line each, and figures derived from a description."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from edited import content_of, edit
from refused import refusal_of

from footfall import Robot, load_robot

WRONG_YAML = (
    ("name: go1", "name: [go1", "valid YAML"),
    ("name: go1", "", "name"),
    ("imu_bus: can0", "imu_bus: can0\ncolour: red", "colour"),
    ("standing_height_m: 0.2945", "standing_height_m: tall", "standing_height_m"),
    ("name: FR_hip_joint, ", "name: FL_hip_joint, ", "twice"),
    ("bus: can0, id: 2", "bus: can0, id: 1", "share"),
    ("bus: can0, id: 2", "bus: can0, id: two", "id"),
    ("motor: hip, ", "motor: shoulder, ", "shoulder"),
    ("base: trunk", "base: torso", "base: robot.xml has no body 'torso'"),
    ("imu: imu", "imu: gyroscope", "imu: robot.xml has no site 'gyroscope'"),
    ("geoms: [FR_foot]", "geoms: [paw]", "foot FR: geoms: robot.xml has no geom 'paw'"),
    ("imu_bus: can0", 'imu_bus: ""', "imu_bus must not be empty"),
    ("bus: can0, id: 1", 'bus: " ", id: 1', "joints[0]: bus must not be empty"),
    ("{name: FL, geoms", '{name: "", geoms', "feet[1]: name must not be empty"),
    ("geoms: [FR_foot]", 'force_bus: "", geoms: [FR_foot]', "feet[0]: force_bus must not be empty"),
    ("geoms: [FR_foot]", "geoms: []", "geoms must name at least one"),
    ("joints: [FR_hip_joint,", "joints: [FR_fin_joint,", "FR_fin_joint"),
    ("model: robot.xml", "model: other.xml", "other.xml"),
    ("gear_ratio: 6.0", "gear_ratio: 0", "gear_ratio must be above 0"),
    ("no_load_speed_rad_s: 30.1", "no_load_speed_rad_s: .nan", "no_load_speed_rad_s: not a finite number"),
    ("peak_torque_nm: 23.7", "peak_torque_nm: -23.7", "motors['hip']: peak_torque_nm must be above 0"),
    ("torque_share: 0.3", "torque_share: 0", "gains: torque_share must be from"),
    ("standing_height_m: 0.2945", "standing_height_m: .inf", "standing_height_m: not a finite number"),
    ("soft_limit_factor: 0.95", "soft_limit_factor: 1.5", "soft_limit_factor must be at most 1"),
    ("target_rate_rad_s: 60.0", "target_rate_rad_s: 0", "target_rate_rad_s must be above 0"),
    ("forward_m_s: [", "forward_m_s: [9, ", "forward_m_s"),
    ("default_rad: -1.8, ", "default_rad: -2.8, ", "FR_calf_joint: default_rad -2.8 is outside the soft"),
    ("default_rad: -1.8, ", "default_rad: -0.9, ", "FR_calf_joint: default_rad -0.9 is outside the soft"),
    ("geoms: [FR_foot]", "geoms: [FR_foot, FL_foot]", "geom FL_foot is listed twice"),
    ("bus: can0, id: 1", "bus: can0, id: 0", "joints[0]: id must be from 1 to 127"),
    ("bus: can0, id: 1", "bus: can0, id: 128", "joints[0]: id must be from 1 to 127"),
    ("name: go1", "name: ../go1", "letters, digits"),
    ("stall_torque_nm: 23.7", "stall_torque_nm: 20", "stall_torque_nm 20 is below peak_torque_nm 23.7"),
    ("protocol: AK70-10", "protocol: AK70-10\n    timeout_s: 0.11", "timeout_s must be from 0.01 to 0.1"),
    ("protocol: AK70-10", "protocol: AK70-10\n    watchdog_endpoints: [0, 5]", "watchdog_endpoints must"),
    ("[FR_hip_joint, FR_thigh_joint,", "[FR_hip_joint, FR_hip_joint,", "FR_hip_joint is listed twice"),
    ("limit_factor: 0.95", "limit_factor: 0.05", "FR_hip_joint: default_rad 0.1 is outside the soft limits"),
    ("frequency_hz: 14.0", "frequency_hz: 1.0e+9", "natural_frequency_hz of 1e+09 makes joint"),
    ("frequency_hz: 14.0", "frequency_hz: 1.0e+300", "natural_frequency_hz must be from"),
    ("frequency_hz: 14.0", "frequency_hz: 100", "too stiff for physics steps of 5 ms"),
    ("damping_ratio: 1.0", "damping_ratio: 1000", "too much for its inertia and physics steps of 1 ms"),
    ("friction_speed_rad_s: 0.2", "friction_speed_rad_s: 1.0e-6", "friction at low speed"),
    ("protocol: AK70-10", "protocol: AK70-10\n    load_friction: 1.2", "load_friction must be"),
    ("torque_share: 0.3", "torque_share: 30", "an action of 1 move joint FR_hip_joint by 22.8 rad"),
    ("default_rad: 0.1, ", "default_rad: 3.0, ", "outside -0.863 to 0.863"),
    ("base: trunk", "base: FR_hip", "no free joint"),
    ("[FR_hip_joint, FR_thigh_joint, FR_calf_joint]", "[]", "foot FR: its leg needs a joint at least"),
    ("{name: FL, geoms", "{name: FR, geoms", "listed twice"),
)

WRONG_XML = (
    ('<freejoint name="base"/>', "", "no free joint"),
    ('<joint name="FR_hip_joint" class="abduction"/>', '<joint name="FR_hip_joint" type="ball"/>', "hinge"),
    (' range="-0.863 0.863"', "", "no range"),
    (' armature="0.00403"', "", "no armature"),
    ('frictionloss="1.0"', 'damping="50"', "calf_joint: kd, friction at low speed and damping come to 51.6"),
    ('frictionloss="1.0"', 'frictionloss="-1"', "must not be negative"),
    ('frictionloss="1.0"', 'damping="-1"', "must not be negative"),
    ('range="-0.863 0.863"', 'range="0.863 -0.863"', "FR_hip_joint has no range"),
    ('frictionloss="1.0"', 'damping="0.1 0.2"', "damping in robot.xml must be one number"),
    ('mass="5.204"', 'mass="-5.204"', "robot.xml"),
    ('joint name="FR_hip_joint"', 'joint name="FR_wing_joint"', "robot.xml has no joint 'FR_hip_joint'"),
)


def test_an_unknown_robot_is_refused_with_a_list_of_the_known_ones() -> None:
    message = refusal_of(load_robot, "rex")
    assert all(name in message for name in ("rex", "go1"))


@pytest.mark.parametrize(("file", "rows"), [("robot.yaml", WRONG_YAML), ("robot.xml", WRONG_XML)])
def test_a_wrong_value_is_named(own_folder: Path, file: str, rows: tuple[tuple[str, str, str], ...]) -> None:
    text = (own_folder / file).read_text()
    for old, new, expected in rows:
        edit(own_folder, file, old, new)
        assert expected in refusal_of(load_robot, own_folder), (old, new)
        (own_folder / file).write_text(text)


def test_garbage_is_refused(own_folder: Path) -> None:
    for file, contents in (
        ("robot.yaml", (b"", b"\xff\xfe\x00", b"- a\n- b\n", b"42", b"{{{")),
        ("robot.xml", (b"", b"\xff\xfe\x00", b"<mujoco>", b"<mujoco><actuatr/></mujoco>")),
    ):
        before = (own_folder / file).read_bytes()
        for content in contents:
            (own_folder / file).write_bytes(content)
            assert file in refusal_of(load_robot, own_folder)
        (own_folder / file).write_bytes(before)
    (own_folder / "robot.xml").unlink()
    assert "robot.xml" in refusal_of(load_robot, own_folder)


def test_values_that_contradict_each_other_are_refused(own_folder: Path) -> None:
    declaration = own_folder / "robot.yaml"
    content = yaml.safe_load(declaration.read_text())
    commands = content["commands"]
    reversed_ranges = ({"commands": commands | {axis: [0.2, 0.1]}} for axis in commands)
    for expected, changes in (
        ("at least one joint and one foot", [{"joints": []}, {"feet": []}]),
        ("must be a range from low to high", reversed_ranges),
    ):
        for change in changes:
            declaration.write_text(yaml.safe_dump(content | change))
            assert expected in refusal_of(load_robot, own_folder)


def test_a_battery_may_be_declared_and_no_policy_depends_on_it(own_folder: Path, go1: Robot) -> None:
    pack = {"cells": 2, "capacity_wh": 50.0, "internal_resistance_ohm": 0.1}
    for change, named in (
        ({"voltage_curve": [[0.0, 3.0], [1.0, 2.0]]}, "voltage_curve"),
        ({"voltage_curve": [[0.1, 3.0], [1.0, 4.0]]}, "voltage_curve"),
        ({"chemistry": "lead"}, "'lead'"),
        ({"cells": 0}, "cells"),
        ({"capacity_wh": 0.0}, "capacity_wh"),
        ({"volume": 1.0}, "volume"),
    ):
        with content_of(own_folder / "robot.yaml") as content:
            content["battery"] = pack | change
        assert named in refusal_of(load_robot, own_folder)
    with content_of(own_folder / "robot.yaml") as content:
        content["battery"] = pack | {"voltage_curve": [[0.0, 3.0], [1.0, 4.0]]}
    robot = load_robot(own_folder)
    assert robot.digest == go1.digest
    assert robot.description.battery.open_circuit_v(0.5) == 7.0


def test_an_imu_on_a_leg_is_refused(own_folder: Path) -> None:
    text = (own_folder / "robot.xml").read_text()
    site = text[text.index("<site") : text.index("/>", text.index("<site")) + 2]
    edit(own_folder, "robot.xml", site, "")
    edit(own_folder, "robot.xml", '<joint name="FR_hip_joint"', f'{site}<joint name="FR_hip_joint"')
    assert "imu" in refusal_of(load_robot, own_folder)


def test_gains_follow_from_reflected_inertia(go1: Robot) -> None:
    """kp = I w^2, kd = 2 z I w: a unit inertia at the joint would ring at the declared frequency."""
    gains = go1.description.gains
    np.testing.assert_allclose(np.sqrt(go1.kp / go1.armature) / (2 * np.pi), gains.natural_frequency_hz)
    np.testing.assert_allclose(go1.kd / (2 * np.sqrt(go1.kp * go1.armature)), gains.damping_ratio)
    np.testing.assert_allclose(go1.kp * go1.action_scale, gains.torque_share * go1.motor.peak_torque)


def test_motors_have_the_optional_effects_that_their_file_gives(own_folder: Path, go1: Robot) -> None:
    """Only the knees' motors have them; 20 Hz is a time constant of 8 ms. Each effect changes the digest."""
    effects = (
        ("torque_bandwidth_hz", 20.0, "lag_s", 0.0, 0.0079577),
        ("stribeck_friction_nm", 0.4, "stribeck", 0.0, 0.4),
        ("stribeck_speed_rad_s", 2.0, "stribeck_speed", 1.0, 2.0),
        ("load_friction", 0.1, "load_friction", 0.0, 0.1),
        ("backlash_rad", 0.01, "backlash", 0.0, 0.01),
        ("gear_stiffness_nm_rad", 400.0, "compliance", 0.0, 1 / 400),
        ("voltage_driven", True, "voltage_gain", 0.0, 1.0),
        ("duty_resistance", 0.5, "duty_resistance", 0.0, 0.5),
    )
    with content_of(own_folder / "robot.yaml") as content:
        content["motors"]["knee"] |= {key: value for key, value, *_ in effects}
    robot = load_robot(own_folder)
    assert (go1.motor.lag_s, go1.motor.stribeck, go1.motor.load_friction) == (None, None, None)
    for *_, field, hip, knee in effects:
        np.testing.assert_allclose(getattr(robot.motor, field), np.tile([hip, hip, knee], 4), rtol=1e-5)
    assert robot.digest != go1.digest


def test_each_joint_has_its_own_figures_beside_joints_without_a_motor(own_folder: Path, go1: Robot) -> None:
    """Joints are listed in reverse, a tail has no motor, and all joints differ."""
    tail = '<body name="tail"><joint name="tail" range="-9 9" frictionloss="8" damping="7" armature="6"/>'
    hip = '<body name="RR_hip"'
    edit(own_folder, "robot.xml", hip, f'{tail}<geom size="0.01" mass="0.1"/></body>{hip}')
    expected = []
    for k, name in enumerate(reversed(go1.joint_names)):
        low, high = (go1.lower_rad - 0.01 * k)[11 - k], (go1.upper_rad + 0.02 * k)[11 - k]
        expected.append((low, high, 0.01 + 0.001 * k, 0.1 + 0.01 * k, 0.02 + 0.001 * k))
        figures = 'range="{:g} {:g}" armature="{:g}" frictionloss="{:g}" damping="{:g}"'.format(*expected[k])
        edit(own_folder, "robot.xml", f'name="{name}"', f'name="{name}" {figures}')
    with content_of(own_folder / "robot.yaml") as content:
        content["joints"].reverse()
    robot = load_robot(own_folder)
    found = robot.lower_rad, robot.upper_rad, robot.armature, robot.motor.friction, robot.motor.damping
    np.testing.assert_allclose(np.transpose(found), expected, rtol=1e-5)
    assert robot.motor_figures("gear_ratio").tolist() == [9.0, 6.0, 6.0] * 4
    assert [joints.tolist() for joints in robot.foot_joints] == [[11, 10, 9], [8, 7, 6], [5, 4, 3], [2, 1, 0]]


def test_a_robot_keeps_the_full_path_of_its_folder(own_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The robot's files are found even if the working folder changes later."""
    monkeypatch.chdir(own_folder.parent)
    assert load_robot(own_folder.name).folder == own_folder.resolve()


def test_an_action_of_1_stays_within_the_range(go1: Robot, own_folder: Path) -> None:
    share = go1.description.gains.torque_share / (go1.action_scale / (go1.upper_rad - go1.lower_rad)).max()
    edit(own_folder, "robot.yaml", "torque_share: 0.3", f"torque_share: {0.99 * share}")
    load_robot(own_folder)
    edit(own_folder, "robot.yaml", f"torque_share: {0.99 * share}", f"torque_share: {1.01 * share}")
    assert "torque_share" in refusal_of(load_robot, own_folder)
