"""Faults that are there from the beginning."""

from typing import Any

import numpy as np

from fault_kinds.body import strength, turned_over
from fault_kinds.frames import bus_dead, commands_lost, silent
from fault_kinds.imu import changed, gyro_bias, imu_frame, imu_silent, leaning, loose, scaled
from fault_kinds.kind import IMPLAUSIBLE_S, FaultKind
from fault_kinds.policy import receive_raises, refused
from fault_kinds.replies import (
    ALIKE,
    all_encoders_jump,
    buses_swapped,
    encoder_jumps,
    error,
    ids_swapped,
    rotor_turn,
    temperature,
)
from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.drivers.imu import ACCELERATION_ID, Inertial
from footfall.plant.frame_changes import nothing, turned
from footfall.plant.injection import Injection

UNANSWERED_S = 1.05  # `start_timeout_s`, and a margin
STARTED_S = 1.3  # start-up, and a short time of standing
WALKING_S = 2.0  # and the first steps


def _at_start(name: str, inject: Injection, within_s: float | None = UNANSWERED_S, **rest: Any) -> FaultKind:
    return FaultKind(name, inject, within_s, starting=True, **rest)


def _nan_quaternion(reading: Inertial) -> Inertial:
    return reading._replace(quaternion=(0.0, 0.0, 0.0, 1e-3))


UNANSWERED = "motors and IMU have `start_timeout_s` to answer"
AT_REST = "compared once the robot has stood at rest for a while"
LITTLE = "some joints need little torque while the robot stands; noticed once they need more"
IN_RANGE = (
    "noticed, with the joint's name, once the reading leaves the joint's range; otherwise it looks like "
    "another pose"
)
START = (
    _at_start("a motor is missing", silent(False), reason=UNANSWERED, main=True),
    _at_start("all motors are missing", silent(True), reason=UNANSWERED),
    _at_start("the IMU is missing", imu_silent, reason=UNANSWERED, main=True),
    _at_start("a bus is missing", bus_dead, reason=UNANSWERED),
    _at_start("no commands arrive", commands_lost, reason=UNANSWERED),
    _at_start("a motor reports an error", error(3), IMPLAUSIBLE_S),
    _at_start("quaternion not a number", changed(_nan_quaternion), reason=UNANSWERED),
    _at_start("one encoder off by a turn", encoder_jumps(lambda _: 2 * np.pi), 0.02, main=True),
    _at_start("all encoders off by a turn", all_encoders_jump(2 * np.pi), 0.02),
    _at_start(
        "one encoder off by a turn of the rotor", encoder_jumps(rotor_turn), None, reason=IN_RANGE, main=True
    ),
    _at_start("IMU tilted by 30 degrees", leaning(30.0), IMPLAUSIBLE_S, main=True),
    _at_start("IMU tilted by 15 degrees", leaning(15.0), IMPLAUSIBLE_S),
    _at_start("IMU tilted by 30 degrees, all readings alike", loose(30.0), STARTED_S, reason=AT_REST),
    _at_start("IMU comes loose and tilts at 0.2 rad/s", loose(0.0, 0.2), STARTED_S, reason=AT_REST),
    _at_start("IMU tilted by 5 degrees", leaning(5.0), None, reason="smaller than a possible slope"),
    _at_start("IMU upside down", changed(lambda r: turned(r, 0, 180.0)), IMPLAUSIBLE_S),
    _at_start("IMU on its side, all readings alike", loose(90.0), IMPLAUSIBLE_S, main=True),
    _at_start("acceleration frames lost", imu_frame(ACCELERATION_ID, nothing), reason=UNANSWERED),
    _at_start("acceleration in units of g", scaled("acceleration", *(1 / GRAVITY_M_S2,) * 3), IMPLAUSIBLE_S),
    _at_start("acceleration a fifth too high", scaled("acceleration", 1.2, 1.2, 1.2), IMPLAUSIBLE_S),
    _at_start("acceleration reads zero", scaled("acceleration", 0.0, 0.0, 0.0), IMPLAUSIBLE_S),
    _at_start("gyro off by 2 rad/s", gyro_bias(2.0), reason=UNANSWERED),
    _at_start("robot upside down", turned_over((0.0, 1.0, 0.0, 0.0)), IMPLAUSIBLE_S),
    _at_start("robot on its side", turned_over((1.0, 1.0, 0.0, 0.0)), IMPLAUSIBLE_S, main=True),
    _at_start("a motor at 90 degrees Celsius", temperature(90), IMPLAUSIBLE_S),
    _at_start("ids of two motors swapped", ids_swapped, WALKING_S, main=True, reason=ALIKE),
    _at_start("two buses swapped", buses_swapped, STARTED_S, reason=ALIKE),
    _at_start("motor's torque reversed", strength(-1.0), STARTED_S, reason=LITTLE),
    _at_start("the interface refuses frames", refused, 0.01),
    _at_start("receiving raises", receive_raises, 0.01),
)
