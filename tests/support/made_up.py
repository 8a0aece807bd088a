"""Invented robots with other lengths, axes and numbers of hinges, for tests that must hold for any robot."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import yaml

from footfall.common.config import structure
from footfall.robots.description import Robot, load_robot
from footfall.robots.mjcf import load_spec
from footfall.robots.robot_yaml import Description
from footfall.robots.stance import touching_height

Vector = tuple[float, float, float]
BALL = ('type="sphere" size="0.025"',)
PLATE = ('type="box" size="0.09 0.04 0.01" pos="0.02 0 -0.015"',)
SOLE = tuple(  # four spheres at the corners of a sole whose middle is ahead of the ankle
    f'type="sphere" size="0.012" pos="{x:g} {y:g} -0.015"' for x in (0.1, -0.04) for y in (0.03, -0.03)
)


class Hinge(NamedTuple):
    """A joint of a made-up limb."""

    axis: Vector
    link: Vector  # from this joint to the next, or to the foot
    default: float
    range: tuple[float, float] = (-1.6, 1.6)


class Leg(NamedTuple):
    """A made-up limb."""

    name: str
    at: Vector  # its first joint, from the base
    hinges: Sequence[Hinge]
    foot: Sequence[str] = BALL  # attributes of its geoms


def write_robot(folder: Path, legs: Sequence[Leg]) -> Robot:
    """A robot of a box and legs, written to a folder and loaded from there."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "robot.xml").write_text(_mjcf(legs))
    content = _declaration(legs)
    model = load_spec(folder / "robot.xml").compile()
    content["standing_height_m"] = round(
        touching_height(structure(content, Description, "made up"), model), 4
    )
    (folder / "robot.yaml").write_text(yaml.safe_dump(content))
    return load_robot(folder)


def _mjcf(legs: Sequence[Leg]) -> str:
    bodies = "\n".join(_body(leg, 0, leg.at) for leg in legs)
    return f"""<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
      <body name="box" pos="0 0 1"><freejoint/><site name="imu" pos="0.02 0.01 0.03"/>
      <geom type="box" size="0.12 0.08 0.04" mass="4.0"/>{bodies}</body></worldbody></mujoco>"""


def _body(leg: Leg, index: int, at: Vector) -> str:
    hinge = leg.hinges[index]
    start, end, axis = (" ".join(f"{x:g}" for x in vector) for vector in (at, hinge.link, hinge.axis))
    last = index + 1 == len(leg.hinges)
    feet = "".join(
        f'<geom name="{leg.name}_foot{k}" {geom} mass="0.02" friction="1" priority="1"/>'
        for k, geom in enumerate(leg.foot)
    )
    inner = f'<body pos="{end}">{feet}</body>' if last else _body(leg, index + 1, hinge.link)
    return f"""<body pos="{start}">
      <joint name="{leg.name}{index}" axis="{axis}" range="{hinge.range[0]} {hinge.range[1]}"
             armature="0.01" frictionloss="0.1" damping="0.05"/>
      <geom type="capsule" size="0.01" fromto="0 0 0 {end}" mass="0.15" contype="0" conaffinity="0"/>
      {inner}</body>"""


def _declaration(legs: Sequence[Leg]) -> dict:
    motor = {
        "peak_torque_nm": 20.0, "stall_torque_nm": 20.0, "no_load_speed_rad_s": 20.0,
        "friction_speed_rad_s": 0.3, "gear_ratio": 9.0, "torque_constant_nm_a": 0.1,
        "winding_resistance_ohm": 0.2, "protocol": "AK70-10",
    }  # fmt: skip
    joints = [
        dict(name=f"{leg.name}{k}", motor="motor", default_rad=hinge.default, bus=leg.name, id=k + 1)
        for leg in legs
        for k, hinge in enumerate(leg.hinges)
    ]
    feet = []
    for leg in legs:
        geoms = [f"{leg.name}_foot{k}" for k in range(len(leg.foot))]
        of_leg = [f"{leg.name}{k}" for k in range(len(leg.hinges))]
        feet.append({"name": leg.name, "geoms": geoms, "joints": of_leg})
    base = {"name": "made_up", "model": "robot.xml", "base": "box", "imu": "imu", "imu_bus": "imu"}
    gains = {"natural_frequency_hz": 8.0, "damping_ratio": 1.0, "torque_share": 0.3}
    limits = {"standing_height_m": 1.0, "soft_limit_factor": 0.98, "target_rate_rad_s": 20.0}
    commands = {"forward_m_s": [-0.4, 0.5], "leftward_m_s": [-0.2, 0.2], "yaw_rad_s": [-0.6, 0.6]}
    parts = {"motors": {"motor": motor}, "joints": joints, "feet": feet}
    return base | limits | parts | {"gains": gains, "commands": commands}


ROLL, PITCH, YAW = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


def quadruped_leg(name: str, x: float, y: float, scale: float = 1.0) -> Leg:
    """Abduction, hip and knee: a leg with a closed form."""
    hinges = (
        Hinge(ROLL, (0.0, math.copysign(0.06, y) * scale, 0.0), 0.05, (-0.9, 0.9)),
        Hinge(PITCH, (0.0, 0.0, -0.2 * scale), 0.8, (-0.6, 2.6)),
        Hinge(PITCH, (0.01, 0.0, -0.21 * scale), -1.5, (-2.7, -0.4)),
    )
    return Leg(name, (x, y, 0.0), hinges)


def four_hinge_leg(name: str, x: float, y: float) -> Leg:
    """Yaw, then roll, pitch and a knee with an oblique axis: without a closed form."""
    out = math.copysign(0.05, y)
    hinges = (
        Hinge(YAW, (0.02, out, 0.0), 0.1, (-0.8, 0.8)),
        Hinge(ROLL, (0.0, out, -0.02), -0.1, (-0.8, 0.8)),
        Hinge(PITCH, (0.0, 0.0, -0.18), 0.7, (-0.5, 2.0)),
        Hinge((0.1, 0.99, 0.05), (0.0, 0.01, -0.2), -1.3, (-2.5, -0.3)),
    )
    return Leg(name, (x, y, 0.0), hinges)


def biped_leg(name: str, y: float) -> Leg:
    """Hip roll, hip pitch, knee and no ankle."""
    hinges = (
        Hinge(ROLL, (0.0, 0.0, -0.03), 0.0, (-0.5, 0.5)),
        Hinge(PITCH, (0.0, 0.0, -0.25), 0.4, (-1.0, 1.8)),
        Hinge(PITCH, (0.0, 0.0, -0.25), -0.8, (-2.3, -0.1)),
    )
    return Leg(name, (0.0, y, -0.05), hinges)


def six_hinge_leg(name: str, y: float, foot: Sequence[str] = SOLE) -> Leg:
    """Hip yaw, roll and pitch, knee, ankle pitch and roll, as a humanoid has them."""
    hinges = (
        Hinge(YAW, (0.01, 0.0, -0.04), 0.0, (-0.8, 0.8)),
        Hinge(ROLL, (0.0, 0.0, -0.03), 0.0, (-0.5, 0.5)),
        Hinge(PITCH, (0.0, 0.0, -0.25), -0.4, (-1.6, 1.0)),
        Hinge(PITCH, (0.0, 0.0, -0.25), 0.8, (0.05, 2.3)),
        Hinge(PITCH, (0.0, 0.0, -0.02), -0.4, (-1.2, 0.8)),
        Hinge(ROLL, (0.0, 0.0, -0.03), 0.0, (-0.4, 0.4)),
    )
    return Leg(name, (0.0, y, -0.05), hinges, foot)


FIVE, BIPED, SOLES = ("five legs, one of four hinges", "biped without ankles", "six hinges and soles")


def bodies(folder: Path) -> dict[str, Robot]:
    """One robot of each kind."""
    five = [
        quadruped_leg("a", 0.2, 0.1),
        quadruped_leg("b", 0.18, -0.1, 1.1),
        quadruped_leg("c", -0.2, 0.12),
        quadruped_leg("d", -0.22, -0.1),
        four_hinge_leg("e", -0.02, 0.14),
    ]
    return {
        FIVE: write_robot(folder / "five", five),
        BIPED: write_robot(folder / "biped", [biped_leg("l", 0.08), biped_leg("r", -0.08)]),
        SOLES: write_robot(folder / "six", [six_hinge_leg("l", 0.09), six_hinge_leg("r", -0.09, PLATE)]),
    }
