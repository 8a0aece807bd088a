"""Checks whether policy, robot and buses of a run fit together."""

import math

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.frames import BITRATE
from footfall.deploy.wiring import Wiring
from footfall.policies.policy import Policy
from footfall.robots.description import Robot


def check_contract(policy: Policy, robot: Robot) -> None:
    """Raise UserError for a policy whose contract does not fit the robot; the message has the differences."""
    differences = [] if policy.contract is None else policy.contract.mismatches(robot)
    if differences:
        raise UserError(f"policy '{policy.name}' does not fit robot '{robot.name}': {'; '.join(differences)}")


def check_get_up(policy: Policy, robot: Robot) -> None:
    """Raise UserError for a robot that cannot get up in a run, or not with this policy."""
    if robot.description.held_start:
        raise UserError(
            f"{robot.name} cannot get up in a run: it does not stand still (held_start in robot.yaml)"
        )
    if policy.needs_estimate:
        raise UserError(
            f"policy '{policy.name}' cannot get a robot up: it needs the base's velocity,"
            " which is unknown after a fall"
        )


def check_joint_rate(wiring: Wiring, driver: Driver, rate_hz: float) -> None:
    """Raise UserError for a rate at which command and reply of each motor may not fit on their bus.

    The number of stuff bits in a frame depends on its content: the largest number is used, as on simulated
    wires. Frames of an IMU and of force sensors are additional, at their own rates.
    """
    bits = np.bincount(wiring.channel, weights=driver.exchange_bits)
    fullest = int(bits.argmax())
    fastest_hz = BITRATE / bits[fullest]
    if rate_hz > fastest_hz:
        motors = np.count_nonzero(wiring.channel == fullest)
        raise UserError(
            f"joint_rate_hz is {rate_hz:g}: {motors} motors on {wiring.buses[fullest]}"
            f" allow at most {math.floor(fastest_hz)} Hz: lower joint_rate_hz (--config),"
            " or give some of them another bus (robot.yaml)"
        )
