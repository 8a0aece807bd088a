"""Gravity in the IMU's readings while the robot rests, before its motors get stiffness."""

from typing import Any

import numpy as np
from frame_robot import TICK_US, Vector

from footfall.deploy.drivers import imu
from footfall.deploy.first_rest import FirstRest
from footfall.deploy.sensor_checks.imu import ImuLimits

STILL, GRAVITY = (0.0, 0.0, 0.0), (0.0, 0.0, 9.81)


def update(
    rest: FirstRest, tick: int, gyro: Vector = STILL, acceleration: Vector = GRAVITY, velocity: Any = (0, 0)
) -> None:
    rest.update(tick * TICK_US, imu.Inertial(gyro, acceleration, (1.0, 0.0, 0.0, 0.0)), np.array(velocity))


def test_the_fastest_part_is_named() -> None:
    """A robot that moves at 0.3 rad/s is not at rest, and never begins to stand up."""
    message = "the robot is not at rest for 0.05 s before it gets stiffness: "
    for gyro, velocity, source in (
        ((0.0, 0.0, -0.31), (0.0, 0.2), "the IMU's gyro reads 0.31 rad/s"),
        ((0.31, 0.0, 0.0), (0.0, 0.0), "the IMU's gyro reads 0.31 rad/s"),
        ((0.2, 0.0, 0.0), (0.0, -0.31), "knee reads 0.31 rad/s"),
        ((0.0, 0.0, 0.0), (0.31, 0.0), "hip reads 0.31 rad/s"),
        ((0.29, -0.29, 0.29), (-0.29, 0.29), ""),
    ):
        rest = FirstRest(0.05, ImuLimits(), ["hip", "knee"])
        assert rest.not_at_rest(0) == ""  # no reading yet
        for tick in range(100):
            update(rest, tick, gyro, velocity=velocity)
        assert rest.not_at_rest(100 * TICK_US) == (message + source if source else "")


def test_motion_before_does_not_hide_a_wrong_gravity_at_rest() -> None:
    """Gravity is a fifth too large after a motion. Without a required time at rest it is not checked."""
    rest = FirstRest(0.05, ImuLimits(), ["hip", "knee"])
    for tick in range(21):
        update(rest, tick, (0.0, float(tick == 20), 0.0))
    for tick in range(20, 45):  # 0.05 s
        assert rest.not_at_rest(tick * TICK_US)
        update(rest, tick + 1, acceleration=(0.0, 0.0, 1.2 * 9.81))
    assert rest.not_at_rest(45 * TICK_US) == ""
    assert rest.contradiction().fault.endswith("gravity by 20%")
    rest = FirstRest(0.0, ImuLimits(), ["hip", "knee"])
    update(rest, 0, acceleration=(0.0, 0.0, -9.81))
    assert (rest.not_at_rest(0), rest.contradiction()) == ("", None)
