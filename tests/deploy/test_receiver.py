"""The latest reading of each motor; a returned reading never changes."""

import numpy as np
import pytest

from footfall.deploy.drivers.driver import Motors, Replies
from footfall.deploy.drivers.imu import ImuReader
from footfall.deploy.frames import Frames
from footfall.deploy.receiver import Receiver


class Scripted:
    """A driver of three motors whose replies are given, whatever the frames are."""

    def __init__(self) -> None:
        self.next: Replies

    def replies(self, frames: Frames) -> Replies:
        return self.next


ONE_FRAME = Frames(np.array([0]), np.array([1]), np.zeros((1, 8), np.uint8), np.array([8]))


@pytest.fixture
def driver() -> Scripted:
    return Scripted()


@pytest.fixture
def receiver(driver: Scripted) -> Receiver:
    return Receiver(driver, ImuReader(0), 3)  # type: ignore[arg-type]


def replies(motor: Motors, temperature_c: list[float], voltage: list[float], at_us: list[int]) -> Replies:
    k = len(temperature_c)
    zeros = np.zeros((3, k))
    return Replies(motor, zeros, np.full(k, 3), np.array(temperature_c), np.array(voltage), np.array(at_us))


def test_temperature_and_voltage_are_copies_of_readings(driver: Scripted, receiver: Receiver) -> None:
    driver.next = replies(slice(None), [50.0, 51.0, 52.0], [24.0, 25.0, 26.0], [0, 0, 0])
    receiver.absorb([ONE_FRAME], 0)
    before = receiver.temperature_c, receiver.voltage
    driver.next = replies(np.array([1]), [30.0], [np.nan], [1000])
    receiver.absorb([ONE_FRAME], 1000)
    assert [part.tolist() for part in before] == [[50.0, 51.0, 52.0], [24.0, 25.0, 26.0]]
    assert receiver.temperature_c.tolist() == [50.0, 30.0, 52.0]
    np.testing.assert_array_equal(receiver.voltage, [24.0, np.nan, 26.0])


def test_health_is_of_each_motor_and_the_imus_age_comes_last(driver: Scripted, receiver: Receiver) -> None:
    """Motors replied at 1, 2 and 3 ms; now it is 20 ms. The IMU has sent nothing."""
    driver.next = replies(slice(None), [30.0, 31.0, 32.0], [24.0, 25.0, 26.0], [1000, 2000, 3000])
    receiver.absorb([ONE_FRAME], 4000)
    health = receiver.health(20_000)
    np.testing.assert_allclose(health.age_s[:3], [0.019, 0.018, 0.017])
    assert health.age_s[3] > 1e6
    assert health.temperature_c.tolist() == [30.0, 31.0, 32.0]
    assert health.voltage.tolist() == [24.0, 25.0, 26.0]
    assert health.error.tolist() == [3, 3, 3]
