"""Gravity in the IMU's readings while the robot rests, before its motors get stiffness."""

import numpy as np
import pytest
from frame_robot import TICK_US, Vector

from footfall.deploy.drivers import imu
from footfall.deploy.first_rest import FirstRest
from footfall.deploy.sensor_checks.imu import ImuLimits


class TestFirstRest:
    """A level robot that must keep still for 0.05 s, with readings at 500 Hz."""

    TURNING = (0.0, 1.0, 0.0)  # rad/s
    STILL = (0.0, 0.0, 0.0)
    GRAVITY = (0.0, 0.0, 9.81)

    def looked(self, before: list[tuple[Vector, Vector]], at_rest: Vector) -> tuple[FirstRest, int]:
        """The finding at the first tick that passes the check of rest, and the time of that tick.

        `before` are gyro and acceleration of ticks up to the last motion; from then on it rests.
        """
        rest = FirstRest(0.05, ImuLimits(), ["hip"])
        for tick, (gyro, acceleration) in enumerate([*before, *[(self.STILL, at_rest)] * 100]):
            now_us = tick * TICK_US
            rest.update(now_us, imu.Inertial(gyro, acceleration, (1.0, 0.0, 0.0, 0.0)), np.zeros(1))
            if not rest.not_at_rest(now_us):
                return rest, now_us
        pytest.fail("it waits for ever")

    @pytest.mark.parametrize(
        ("gyro", "velocity", "who"),
        [
            ((0.0, 0.0, -0.31), (0.0, 0.2), "the IMU's gyro reads 0.31 rad/s"),
            ((0.31, 0.0, 0.0), (0.0, 0.0), "the IMU's gyro reads 0.31 rad/s"),
            ((0.2, 0.0, 0.0), (0.0, -0.31), "knee reads 0.31 rad/s"),
            ((0.0, 0.0, 0.0), (0.31, 0.0), "hip reads 0.31 rad/s"),
            ((0.29, -0.29, 0.29), (-0.29, 0.29), ""),
        ],
    )
    def test_the_fastest_part_is_named(self, gyro: Vector, velocity: tuple[float, float], who: str) -> None:
        """A robot that moves at 0.3 rad/s is not at rest, and never begins to stand up."""
        rest = FirstRest(0.05, ImuLimits(), ["hip", "knee"])
        assert rest.not_at_rest(0) == ""  # no reading yet
        for now_us in range(0, 200_000, TICK_US):
            rest.update(now_us, imu.Inertial(gyro, self.GRAVITY, (1.0, 0.0, 0.0, 0.0)), np.array(velocity))
        message = "the robot is not at rest for 0.05 s before it gets stiffness: "
        assert rest.not_at_rest(200_000) == (message + who if who else "")

    def test_motion_before_does_not_hide_a_wrong_gravity_at_rest(self) -> None:
        """Gravity is a fifth too large. If no time of rest is required, gravity is not checked."""
        before = [(self.STILL, self.GRAVITY)] * 20 + [(self.TURNING, self.GRAVITY)]
        rest, _ = self.looked(before, (0.0, 0.0, 1.2 * 9.81))
        found = rest.contradiction()
        assert found is not None
        assert found.fault.endswith("gravity by 20%")
        rest = FirstRest(0.0, ImuLimits(), ["hip"])
        rest.update(0, imu.Inertial(self.STILL, (0.0, 0.0, -9.81), (1.0, 0.0, 0.0, 0.0)), np.zeros(1))
        assert (rest.not_at_rest(0), rest.contradiction()) == ("", None)
