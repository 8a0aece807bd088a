"""Motors of a machine: from the user, or else from its file, or else guessed."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.errors import UserError
from footfall.robots.importer.build import shortened
from footfall.robots.importer.machine import Hinge, Machine
from footfall.robots.importer.source import Source
from footfall.robots.importer.statics import Statics

# The joints of Go1 and G1, whose rotor inertias are published, have 1.2e-4 to 2.5e-4.
ARMATURE_PER_TORQUE = 1.7e-4  # kg m^2 per N m of peak torque
NO_LOAD_SPEED_RAD_S = 30.0  # if a file gives none
MAX_SPEED_RAD_S = 60.0  # larger values in a file are implausible
FRICTION_SPEED_RAD_S = 0.2
PLANT_STEP_S = 0.001
FRICTION_SHARE = 0.3  # share of a velocity that the friction ramp may remove in one step of the plant
MAX_LEVERAGE = 3.0  # torque over weight times reach; larger values in a file are implausible
# Position error at which the stiffness demands the peak torque: 0.5 to 1.1 on Go1 and G1.
PEAK_TORQUE_ERROR_RAD = 0.75
MAX_SAG_RAD = 0.12  # largest position error under the robot's own weight
STABILITY_MARGIN = 2.0  # stiffness over the smallest stiffness with which the machine stands
GEAR_RATIO = 10.0  # of medium-sized motors; used for the copper loss only
FREQUENCIES_HZ = tuple(np.arange(1.0, 61.0, 0.5).tolist())

ByJoint = Mapping[str, float]  # value by part of a joint's name; '' is in every name


class JointMotor(NamedTuple):
    """The motor of one joint."""

    peak_torque_nm: float
    no_load_speed_rad_s: float
    friction_speed_rad_s: float
    gear_ratio: float = GEAR_RATIO


@dataclass(frozen=True)
class Drive:
    """Motors and gains."""

    motors: dict[str, JointMotor]  # by joint, in joint order
    natural_frequency_hz: float
    torque_share: float
    stands: bool  # by itself, according to `Statics`
    guesses: tuple[str, ...]

    def stiffest(self, machine: Machine) -> float:
        """Largest stiffness of a joint, N m/rad."""
        return max(hinge.armature for hinge in machine.hinges) * (2 * np.pi * self.natural_frequency_hz) ** 2


def value_for(joint: str, values: ByJoint) -> float | None:
    """The value whose key is part of the joint's name; the longest key wins."""
    fitting = [key for key in values if key in joint]
    return values[max(fitting, key=len)] if fitting else None


def with_armature(machine: Machine, peak: Mapping[str, float], given: ByJoint) -> tuple[Machine, list[str]]:
    """The machine with a reflected inertia for each joint, and the guesses.

    The inertia is the given value, or else the value in the file, or else proportional to the peak torque
    (`ARMATURE_PER_TORQUE`).
    """
    estimated: list[str] = []

    def armature(hinge: Hinge) -> float:
        from_user = value_for(hinge.name, given)
        if from_user is not None:
            return from_user
        if hinge.armature > 0.0:
            return hinge.armature
        estimated.append(hinge.name)
        return ARMATURE_PER_TORQUE * peak[hinge.name]

    hinges = {hinge.name: replace(hinge, armature=armature(hinge)) for hinge in machine.hinges}
    guesses = []
    if estimated:
        guesses.append(
            f"reflected inertia of {shortened(estimated)}: estimated as {ARMATURE_PER_TORQUE:g} kg m^2 per"
            " N m of peak torque; the gains follow from it, so measure it or give --armature"
        )
    return machine.with_hinges(hinges), guesses


def peak_torques(machine: Machine, source: Source, given: ByJoint, reach_m: float) -> dict[str, float]:
    """Peak torque of each joint, N m: the given one, or else the one in the file.

    Raises:
        UserError: a joint has none, or the value in the file is implausible for a machine of this weight.
    """
    peak = {}
    max_torque = MAX_LEVERAGE * machine.mass * GRAVITY_M_S2 * reach_m
    for hinge in machine.hinges:
        from_user, from_file = value_for(hinge.name, given), source.peak_torque_nm.get(hinge.name)
        if from_user is None and from_file is None:
            raise UserError(
                f"{source.path}: joint {hinge.name} has no peak torque (effort): give --peak-torque"
            )
        if from_user is None and from_file is not None and from_file > max_torque:
            raise UserError(
                f"{source.path}: joint {hinge.name} has a peak torque of {from_file:g} N m, which"
                f" is implausible for a machine of {machine.mass:.3g} kg: give --peak-torque"
            )
        torque = from_file if from_user is None else from_user
        peak[hinge.name] = float(torque or 0.0)
    return peak


def choose_drive(
    machine: Machine,
    source: Source,
    peak: Mapping[str, float],
    speed: ByJoint,
    standing: Statics,
    gear: ByJoint | None = None,
) -> Drive:
    """Motors, and gains with which the machine stands if possible.

    The stiffness of a joint is its reflected inertia times the square of one natural frequency. It is chosen
    so that the median joint demands its peak torque at an error of `PEAK_TORQUE_ERROR_RAD`, or stiffer if
    standing requires it.

    Raises:
        UserError: a joint needs more than its peak torque to stand.
    """
    hinges = machine.hinges
    _refuse_weak(machine, source, peak, standing)
    armature = np.array([hinge.armature for hinge in hinges])
    torque = np.array([peak[hinge.name] for hinge in hinges])
    typical_hz = float(np.sqrt(np.median(torque / armature) / PEAK_TORQUE_ERROR_RAD) / (2 * np.pi))
    guesses = [
        "torque-speed line: from the peak torque at rest to the no-load speed",
        f"winding{'' if gear else ' and gear ratio'}: assumed, only used for the copper loss",
    ]
    if not any(hinge.friction or hinge.damping for hinge in hinges):
        guesses.append("friction and damping of the joints: none, because the file gives none")

    def stiffness(frequency: float) -> np.ndarray:
        return armature * (2 * np.pi * frequency) ** 2

    def stands(frequency: float) -> bool:
        kp = stiffness(frequency)
        sag = float(np.abs(standing.torque_nm / kp).max())
        return sag < MAX_SAG_RAD and standing.stable(kp / STABILITY_MARGIN)

    frequency = next((f for f in FREQUENCIES_HZ if f >= typical_hz - 0.25 and stands(f)), None)
    is_stable = frequency is not None
    if frequency is None:
        frequency = min(FREQUENCIES_HZ, key=lambda f: abs(f - typical_hz))
        guesses.append("the robot cannot stand by joint stiffness alone: it needs a policy that balances it")
    else:
        guesses.append(f"gains: a natural frequency of {frequency:g} Hz, at which it should stand")
    kp = stiffness(frequency)
    span = np.array([hinge.high - hinge.low for hinge in hinges])
    share = min(0.3, float(0.9 * (span * kp / torque).min()))
    motors, unknown = {}, []
    for hinge in hinges:
        no_load_speed = value_for(hinge.name, speed) or source.speed_rad_s.get(hinge.name, np.inf)
        if no_load_speed > MAX_SPEED_RAD_S:
            unknown.append(hinge.name)
            no_load_speed = NO_LOAD_SPEED_RAD_S
        ramp = hinge.friction * PLANT_STEP_S / (FRICTION_SHARE * hinge.armature)
        ratio = value_for(hinge.name, gear or {}) or GEAR_RATIO
        friction_speed = max(FRICTION_SPEED_RAD_S, _ceil(ramp))
        motors[hinge.name] = JointMotor(peak[hinge.name], no_load_speed, friction_speed, ratio)
    if unknown:
        guesses.append(f"no-load speed of {shortened(unknown)}: {NO_LOAD_SPEED_RAD_S:g} rad/s")
    return Drive(motors, frequency, _floor(share), is_stable, tuple(guesses))


def _refuse_weak(machine: Machine, source: Source, peak: Mapping[str, float], standing: Statics) -> None:
    """Raise UserError if joints need more than their peak torque to stand; the worst is named first."""
    needed = dict(zip((hinge.name for hinge in machine.hinges), np.abs(standing.torque_nm), strict=True))
    weak = sorted((name for name in needed if needed[name] > peak[name]), key=lambda n: peak[n] / needed[n])
    if weak:
        listed = shortened([f"{name} {needed[name]:.3g} of {peak[name]:.3g} N m" for name in weak])
        raise UserError(
            f"{source.path}: motors are too weak to stand in the default pose: {machine.mass:.3g} kg need"
            f" {listed}: correct the masses, or give --peak-torque"
        )


def _ceil(value: float) -> float:
    return float(np.ceil(value * 100) / 100)


def _floor(value: float) -> float:
    return float(np.floor(value * 1000) / 1000) or value
