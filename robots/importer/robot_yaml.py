"""Writes `robot.yaml`, with its guesses as comments."""

import json
from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.robots.commands import CommandRange
from footfall.robots.importer.machine import Leg, Machine
from footfall.robots.importer.model_xml import IMU
from footfall.robots.importer.motors import Drive, JointMotor
from footfall.robots.importer.pose import Pose

MODEL_FILE = "robot.xml"
HELD_START = (
    "# The robot cannot stand still on two points: a run holds it up until it steps in place.",
    "held_start: true",
)
SOFT_LIMIT_FACTOR = 0.95
DAMPING_RATIO = 1.0
# Largest command over sqrt(gravity times leg length), and rad/s of yaw: on two legs, and on more.
TWO_LEGS, MORE_LEGS = (0.25, 0.6), (0.45, 1.0)
MOTORS_PER_BUS = 3  # at 500 Hz and 1 Mbit/s, together with an IMU
TARGET_RATE_SHARE = 2.0  # of the fastest joint's no-load speed
# Of medium-sized motors; used for the copper loss only.
TORQUE_CONSTANT, WINDING_RESISTANCE = 0.1, 0.2


class Ranges(Protocol):
    """Ranges of the frames of a motor model."""

    @property
    def velocity(self) -> float: ...
    @property
    def torque(self) -> float: ...
    @property
    def kp(self) -> float: ...
    @property
    def kd(self) -> float: ...


def robot_yaml(
    machine: Machine,
    pose: Pose,
    drive: Drive,
    protocols: Mapping[str, str],
    notes: Iterable[str],
    lying: Mapping[str, float] | None = None,
) -> str:
    """The text of `robot.yaml`.

    Args:
        machine: machine with the reflected inertia of its joints.
        pose: the default pose.
        drive: motors and gains.
        protocols: motor model of each joint.
        notes: guesses, for the comment at the top.
        lying: joints with the base on the ground, rad, if it can lie.
    """
    types = list(dict.fromkeys((drive.motors[h.name], protocols[h.name]) for h in machine.hinges))
    names = {kind: f"motor_{index + 1}" for index, kind in enumerate(types)}
    kinds = {h.name: names[drive.motors[h.name], protocols[h.name]] for h in machine.hinges}
    fastest = max(motor.no_load_speed_rad_s for motor in drive.motors.values())
    buses = _buses(machine)
    lines = [
        *(f"# {note}" for note in notes),
        f"name: {_text(machine.name)}",
        f"model: {MODEL_FILE}",
        f"base: {_text(machine.links[0].name)}",
        f"imu: {IMU}",
        f"standing_height_m: {pose.height_m:.4f} # base origin above the ground in the default pose",
        "",
        "# Gains of learned policies, from the reflected inertia I of each joint (armature in robot.xml):",
        "# kp = I w^2, kd = 2 z I w, action scale = torque_share * peak torque / kp.",
        "gains:",
        f"  natural_frequency_hz: {drive.natural_frequency_hz:g}",
        f"  damping_ratio: {DAMPING_RATIO:g}",
        f"  torque_share: {drive.torque_share:g}",
        "",
        f"soft_limit_factor: {SOFT_LIMIT_FACTOR:g}     # share of each joint's range that targets may use",
        f"target_rate_rad_s: {TARGET_RATE_SHARE * fastest:g}     # largest speed of a position target",
        "",
        "# Gear ratio and winding are assumed, and so is the line between peak torque and no-load speed.",
        "# protocol is a placeholder: see deploy/drivers/mit.py for the supported motors.",
        "motors:",
        *(line for kind in types for line in _motor(names[kind], *kind)),
        "",
        "# The joint order of every joint vector. bus and id are placeholders.",
        "joints:",
        *(
            f"  - {{name: {_text(name)}, motor: {kinds[name]}, default_rad: {_angle(pose.joints[name])},"
            f"{f' lying_rad: {_angle(lying[name])},' if lying else ''} bus: {bus}, id: {number}}}"
            for name, (bus, number) in buses.items()
        ),
        "",
        "# Geoms that each foot stands on, and the joints of its leg from the base outwards.",
        "feet:",
        *(_foot(leg) for leg in machine.legs),
        "",
        "# The bus of the IMU's frames: a placeholder.",
        "imu_bus: can0",
        "",
        "# Command ranges of scenarios, scaled from those of other robots by leg length.",
        _commands(command_range(machine, pose)),
    ]
    if not machine.stands_still:
        lines += ["", *HELD_START]
    return "\n".join(lines) + "\n"


def choose_protocols(
    machine: Machine, drive: Drive, known: Mapping[str, Ranges], gains: tuple[float, float] = (0.0, 0.0)
) -> tuple[dict[str, str], list[str]]:
    """Motor model for each joint: the weakest one whose frames have the required ranges.

    If no model has them, the strongest one is chosen, and the joint is in the second result.

    Args:
        machine: the robot.
        drive: its motors and gains.
        known: motor models.
        gains: further stiffness and damping that frames must carry, N m/rad and N m s/rad.
    """
    chosen, out_of_range = {}, []
    by_torque = sorted(known, key=lambda name: known[name].torque)
    w = 2 * np.pi * drive.natural_frequency_hz
    for hinge in machine.hinges:
        motor, kp = drive.motors[hinge.name], max(hinge.armature * w**2, gains[0])
        kd = max(2 * DAMPING_RATIO * hinge.armature * w, gains[1])
        fitting = (name for name in by_torque if _carries(known[name], motor, kp, kd))
        chosen[hinge.name] = next(fitting, by_torque[-1])
        if not _carries(known[chosen[hinge.name]], motor, kp, kd):
            out_of_range.append(hinge.name)
    return chosen, out_of_range


def _carries(ranges: Ranges, motor: JointMotor, kp: float, kd: float) -> bool:
    return (
        ranges.torque >= motor.peak_torque_nm
        and ranges.velocity >= motor.no_load_speed_rad_s
        and ranges.kp >= kp
        and ranges.kd >= kd
    )


def _motor(name: str, motor: JointMotor, protocol: str) -> list[str]:
    return [
        f"  {name}:",
        f"    peak_torque_nm: {motor.peak_torque_nm:g}",
        f"    stall_torque_nm: {motor.peak_torque_nm:g}",
        f"    no_load_speed_rad_s: {motor.no_load_speed_rad_s:g}",
        f"    friction_speed_rad_s: {motor.friction_speed_rad_s:g}",
        f"    gear_ratio: {motor.gear_ratio:g}",
        f"    torque_constant_nm_a: {TORQUE_CONSTANT:g}",
        f"    winding_resistance_ohm: {WINDING_RESISTANCE:g}",
        f"    protocol: {protocol}",
    ]


def _foot(leg: Leg) -> str:
    geoms, joints = (", ".join(map(_text, names)) for names in (leg.geoms, leg.joints))
    return f"  - name: {_text(leg.name)}\n    geoms: [{geoms}]\n    joints: [{joints}]"


def _buses(machine: Machine) -> dict[str, tuple[str, int]]:
    """Bus and id of each joint, in joint order. Each leg has its own buses, and so have the other joints."""
    leg_of = {joint: leg.name for leg in machine.legs for joint in leg.joints}
    can_ids: dict[str, tuple[str, int]] = {}
    filling: dict[str | None, tuple[int, int]] = {}  # bus and number of motors on it
    buses = 0
    for hinge in machine.hinges:
        leg = leg_of.get(hinge.name)
        bus, count = filling.get(leg, (0, MOTORS_PER_BUS))
        if count == MOTORS_PER_BUS:
            bus, count, buses = buses, 0, buses + 1
        filling[leg] = (bus, count + 1)
        can_ids[hinge.name] = (f"can{bus}", count + 1)
    return can_ids


def command_range(machine: Machine, pose: Pose) -> CommandRange:
    """Speeds proportional to sqrt(g L), at a constant Froude number, with L the legs' reach."""
    share, yaw = TWO_LEGS if len(machine.legs) == 2 else MORE_LEGS
    forward = round(share * (GRAVITY_M_S2 * pose.reach_m) ** 0.5, 1)
    leftward = round(share * (GRAVITY_M_S2 * pose.reach_m) ** 0.5 / 2, 1)
    return CommandRange((-forward, forward), (-leftward, leftward), (-yaw, yaw))


def _commands(range_: CommandRange) -> str:
    return (
        f"commands: {{{', '.join(f'{name}: [{a:.1f}, {b:.1f}]' for name, (a, b) in vars(range_).items())}}}"
    )


def _angle(angle: float) -> str:
    return f"{round(angle, 4) + 0.0:g}"


def _text(text: str) -> str:
    """A name as YAML, quoted if YAML could read it as another type."""
    plain = text.replace("_", "").replace("-", "").isalnum() and text[0].isalpha() and text.isascii()
    words = {"true", "false", "yes", "no", "on", "off", "null", "y", "n"}
    return text if plain and text.lower() not in words else json.dumps(text)
