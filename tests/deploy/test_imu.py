"""IMU readings as CAN frames."""

from typing import Any

import numpy as np
import pytest

from footfall.deploy.drivers import imu
from footfall.deploy.frames import Frames


def whole(counter: int) -> np.ndarray:
    reading = imu.Inertial([0.1, 0.2, 0.3], [1.0, 0.0, 9.8], [0.8, 0.0, 0.6, 0.0])
    return imu.encode(reading, counter).copy()


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize(
    ("part", "corrupt"),
    [
        ("gyro", lambda data, length: data.__setitem__((0, slice(6, 8)), [0, 1])),  # the counter stays
        ("acceleration", lambda data, length: data.__setitem__((1, slice(6, 8)), [0, 1])),
        ("quaternion", lambda data, length: data.__setitem__(2, 0)),
        ("quaternion", lambda data, length: data.__setitem__((2, 0), 0)),  # too short to be a rotation
        ("quaternion", lambda data, length: data.__setitem__((2, 2), 0x7F)),  # too long
        ("gyro", lambda data, length: length.__setitem__(0, 7)),
        ("acceleration", lambda data, length: length.__setitem__(1, 2)),
        ("quaternion", lambda data, length: length.__setitem__(2, 1)),
    ],
)
def test_each_part_must_be_renewed_by_complete_frames(part: str, corrupt: Any, at_once: bool) -> None:
    reader = imu.ImuReader(channel=1)
    channel, identifier, length = np.full(3, 1), np.array(imu.IDS), np.full(3, 8)
    reader.absorb(Frames(channel, identifier, whole(1), length), 1000)
    before = reader.reading
    for counter in (2, 3):
        data, lengths = whole(counter), length.copy()
        corrupt(data, lengths)
        same = bool((lengths == 8).all())
        batch = Frames(channel, identifier, data, length if same else lengths)
        if at_once:
            reader.absorb(batch, 1000 * counter)
        else:
            for row in range(3):
                reader.absorb(batch.take(np.array([row])), 1000 * counter)
    assert reader.arrived_us == 1000
    assert reader.oldest == part
    assert reader.reading.quaternion == before.quaternion


# -- the wire, to the bit ----------------------------------------------------------------------------


def test_the_frames_of_a_reading_to_the_bit() -> None:
    """1.5 rad/s are 1500 = 0x05dc units, -1 m/s^2 is -200 = 0xff38, 0.6 is 19660 = 0x4ccc of 32767."""
    reading = imu.Inertial([1.5, -0.001, 0.002], [-1.0, 0.005, 10.0], [0.0, 0.6, -0.8, 1.0])
    assert imu.IDS == (0x300, 0x301, 0x302)
    frames = [row.tobytes() for row in imu.encode(reading, 0x1234)]
    assert [row.hex(" ", 2) for row in frames] == [
        "05dc ffff 0002 1234",
        "ff38 0001 07d0 1234",
        "0000 4ccc 999a 7fff",
    ]
    gyro, counter = imu.decode_gyro(frames[0])
    assert (gyro, counter) == (pytest.approx(reading.gyro), 0x1234)
    assert imu.decode_acceleration(frames[1]) == pytest.approx(reading.acceleration)
    reading = imu.Inertial([0.0] * 3, [0.0] * 3, [1.0, 0.0, 0.0, 0.0])
    for row in imu.encode(reading, 0x3FFFF)[:2]:
        assert row.tobytes().hex(" ", 2) == "0000 0000 0000 ffff"
    beyond = imu.encode(imu.Inertial([99.0, -99.0, 0.0], [999.0, -999.0, 0.0], [2.0, -2.0, 0.0, 0.0]), 0)
    assert [row.tobytes().hex(" ", 2)[:9] for row in beyond] == ["7fff 8000"] * 3


# -- readers -----------------------------------------------------------------------------------------


class Wire:
    """An IMU on bus 1 whose frames come in the same arrays each time, as from a simulated bus."""

    def __init__(self) -> None:
        self.reader = imu.ImuReader(channel=1)
        self.channel, self.id, self.length = np.full(3, 1), np.array(imu.IDS), np.full(3, 8)

    def send(self, counter: int, now_us: int, gyro: float = 0.0) -> None:
        reading = imu.Inertial([gyro, 0.2, 0.3], [1.0, 2.0, 9.0], [0.8, 0.0, 0.6, 0.0])
        data = imu.encode(reading, counter)
        self.reader.absorb(Frames(self.channel, self.id, data, self.length), now_us)


class TestReader:
    @pytest.fixture
    def wire(self) -> Wire:
        return Wire()

    @pytest.mark.parametrize("counters", [(0xFFFE, 0xFFFF, 0x10000), (0xFFFF, 0), (7, 30), (0,)])
    def test_a_higher_counter_is_a_new_reading(self, wire: Wire, counters: tuple) -> None:
        for k, counter in enumerate(counters):
            wire.send(counter, 1000 * k)
            assert wire.reader.arrived_us == 1000 * k

    @pytest.mark.parametrize("counters", [(7, 9, 8), (7, 8, 0x4008), (0, 1, 0xFFFF)])
    def test_an_older_or_far_off_sample_is_ignored(self, wire: Wire, counters: tuple) -> None:
        for k, counter in enumerate(counters):
            wire.send(counter, 1000 * k, gyro=0.1 * k)
        assert wire.reader.arrived_us == 1000
        assert wire.reader.reading.gyro[0] == pytest.approx(0.1)

    @pytest.mark.parametrize("before", [1, 2, 3])
    def test_a_part_has_the_time_of_its_frames_arrival(self, wire: Wire, before: int) -> None:
        """Frames arrive one by one at first, then all at once.

        A queued frame is older than its counter suggests.
        """
        for counter in range(before):
            wire.send(counter, 1000 * counter)
        data = imu.encode(imu.Inertial([0.1, 0.2, 0.3], [1.0, 2.0, 9.0], [0.8, 0.0, 0.6, 0.0]), before)
        arrived = np.array([40_700, 40_500, 40_600])
        wire.reader.absorb(Frames(wire.channel, wire.id, data, wire.length, arrived), 90_000)
        assert wire.reader.arrived_us == 40_500
        assert wire.reader.oldest == "acceleration"
