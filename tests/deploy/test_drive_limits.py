"""Limits of the drives themselves: set from robot.yaml, read back, or refused by name."""

import numpy as np
import pytest
from changed_robots import with_each_motor
from some_motors import MAKERS, with_motors

from footfall import Robot, UserError
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.choice import open_motor_end

# What a maker's drives limit, and the limits of the simulated drives.
LIMITS = {
    "RobStride": ("torque", lambda end: [own[0x700B] for own in end.parameters]),
    "moteus": ("torque", lambda end: end.torque_limit),
    "ODrive": ("current", lambda end: end.current_limit),
}


@pytest.mark.parametrize("maker", LIMITS)
def test_the_drives_limit_is_the_peak_torque_and_is_read_back(go1: Robot, maker: str) -> None:
    limit, limits_of = LIMITS[maker]
    made = with_motors(go1, **MAKERS[maker])
    robot = with_each_motor(made, drive_limit=limit, current_endpoint=301)
    wiring = wiring_of(robot)
    driver, end = open_driver(wiring), open_motor_end(wiring)
    assert not np.allclose(limits_of(end), wiring.highest)
    for _ in range(10):
        answer = end.settings_replies(driver.query_settings())
        if answer is not None:
            driver.replies(answer)
    assert maker == "ODrive" or driver.not_ready() == ""
    motors = [robot.description.motors[joint.motor] for joint in robot.description.joints]
    expected = np.array([motor.peak_torque_nm for motor in motors])
    if limit == "current":
        expected /= [motor.gear_ratio * motor.torque_constant_nm_a for motor in motors]
    np.testing.assert_allclose(limits_of(end), expected, rtol=1e-6)


def test_a_limit_that_a_maker_does_not_have_is_refused(go1: Robot) -> None:
    for maker, limit in (("MIT mode", "torque"), ("Damiao", "current"), ("moteus", "current")):
        robot = with_each_motor(with_motors(go1, **MAKERS[maker]), drive_limit=limit)
        with pytest.raises(UserError, match=f"FR_hip_joint: .*{limit}"):
            open_driver(wiring_of(robot))
