"""Damiao motors: frames by the maker's tables, queries at the start, robots with several makers."""

import numpy as np
from some_motors import frame, hexed, read_settings, two_motors, with_motors

from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.damiao import DamiaoDriver
from footfall.deploy.drivers.mit import MotorRange
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.damiao import DamiaoMotorEnd
from footfall.robots.description import Robot

TWO = two_motors("DM4310", "DM8009")


def test_frames_are_encoded_and_decoded_as_in_the_manual() -> None:
    """3.2 rad in ±12.5 is 15.7 / 25 of 65535: 41156, 0xa0c4. The range uses all codes."""
    driver = DamiaoDriver(TWO)
    read_settings(driver, DamiaoMotorEnd(TWO))
    values = np.array([[-12.5, 3.2], [30.0, -45.0], [0.0, 500.0], [5.0, 0.0], [-10.0, 54.0]])
    frames = driver.command(values)
    assert frames.id.tolist() == [3, 3]
    assert hexed(frames) == ["00 00 ff f0 00 ff f0 00", "a0 c4 00 0f ff 00 0f ff"]
    # State 1 and id 3 share byte 0. Of MOSFETs and rotor the hotter counts. States above 1 are errors.
    replies = driver.replies(frame(0x203, "13 ff ff 00 0f ff 28 2d"))
    assert np.arange(2)[replies.motor].tolist() == [0]
    np.testing.assert_allclose(replies.values[:, 0], [12.5, -30.0, 10.0])
    assert (replies.temperature_c.tolist(), replies.error.tolist()) == ([45], [0])
    assert driver.replies(frame(0x203, "13 ff ff 00 0f ff 2e 2d")).temperature_c.tolist() == [46]
    messages = {0x8: "over-voltage", 0xB: "over-temperature of its MOSFETs", 0xD: "timeout", 0xF: "15"}
    for state, message in messages.items():
        (error,) = driver.replies(frame(0x203, f"{state:x}3 80 00 80 08 00 1e 1e")).error
        assert message in driver.error_name(int(error))


def test_a_motors_own_ranges_are_used() -> None:
    own = [MotorRange(25.0, 12.0, position=6.0), MotorRange(45.0, 54.0)]
    driver, end = DamiaoDriver(TWO), DamiaoMotorEnd(TWO, own)
    assert read_settings(driver, end) == 5  # registers, one at a time
    assert driver.highest[:, 0].tolist() == [6.0, 25.0, 500.0, 5.0, 12.0]
    assert driver.lowest[[0, 1, 4], 0].tolist() == [-6.0, -25.0, -12.0]
    command = np.array([[1.5, -2.0], [3.0, 4.0], [50.0, 60.0], [1.0, 2.0], [5.0, -6.0]])
    np.testing.assert_allclose(end.requests(driver.command(command)).values, command, atol=0.07)


def test_an_error_of_a_mixed_robot_is_named_in_its_makers_words(go1: Robot) -> None:
    driver = open_driver(wiring_of(with_motors(go1, knee="DM8009")))
    assert (driver.error_name(5, 0), driver.error_name(5, 2)) == ("encoder error", "sensor error")
