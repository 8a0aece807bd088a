"""IMU readings as CAN frames."""

import numpy as np
import pytest

from footfall.deploy.drivers import imu
from footfall.deploy.drivers.imu import ImuReader, Inertial
from footfall.deploy.frames import Frames


def frames(counter: int, gyro: float = 0.1, arrived_us: np.ndarray | None = None) -> Frames:
    """A reading of an IMU on bus 1."""
    data = imu.encode(Inertial([gyro, 0.2, 0.3], [1.0, 2.0, 9.0], [0.8, 0.0, 0.6, 0.0]), counter).copy()
    return Frames(np.full(3, 1), np.array(imu.IDS), data, np.full(3, 8), arrived_us)


@pytest.fixture
def reader() -> ImuReader:
    return ImuReader(channel=1)


@pytest.mark.parametrize("at_once", [True, False])
@pytest.mark.parametrize(
    ("part", "columns", "content", "length"),
    [
        (0, slice(6, 8), [0, 1], 8),  # the counter stays
        (1, slice(6, 8), [0, 1], 8),
        (2, slice(8), 0, 8),
        (2, 0, 0, 8),  # too short to be a rotation
        (2, 2, 0x7F, 8),  # too long
        (0, slice(0), 0, 7),
        (1, slice(0), 0, 2),
        (2, slice(0), 0, 1),
    ],
)
def test_each_part_must_be_renewed_by_complete_frames(
    reader: ImuReader, part: int, columns: int | slice, content: int | list[int], length: int, at_once: bool
) -> None:
    reader.absorb(frames(1), 1000)
    before = reader.reading
    for counter in (2, 3):
        batch = frames(counter)
        batch.data[part, columns], batch.length[part] = content, length
        for rows in [[0, 1, 2]] if at_once else [[0], [1], [2]]:
            reader.absorb(batch.take(np.array(rows)), 1000 * counter)
    assert (reader.arrived_us, reader.oldest) == (1000, Inertial._fields[part])
    assert reader.reading.quaternion == before.quaternion


def test_the_frames_of_a_reading_to_the_bit() -> None:
    """1.5 rad/s are 1500 = 0x05dc units, -1 m/s^2 is -200 = 0xff38, 0.6 is 19660 = 0x4ccc of 32767."""
    reading = Inertial([1.5, -0.001, 0.002], [-1.0, 0.005, 10.0], [0.0, 0.6, -0.8, 1.0])
    assert imu.IDS == (0x300, 0x301, 0x302)
    rows = [row.tobytes() for row in imu.encode(reading, 0x1234)]
    hexed = [row.hex(" ", 2) for row in rows]
    assert hexed == ["05dc ffff 0002 1234", "ff38 0001 07d0 1234", "0000 4ccc 999a 7fff"]
    assert imu.decode_gyro(rows[0]) == (pytest.approx(reading.gyro), 0x1234)
    assert imu.decode_acceleration(rows[1]) == pytest.approx(reading.acceleration)
    for row in imu.encode(Inertial([0.0] * 3, [0.0] * 3, [1.0, 0.0, 0.0, 0.0]), 0x3FFFF)[:2]:
        assert row.tobytes().hex(" ", 2) == "0000 0000 0000 ffff"
    beyond = imu.encode(Inertial([99.0, -99.0, 0.0], [999.0, -999.0, 0.0], [2.0, -2.0, 0.0, 0.0]), 0)
    assert [row.tobytes().hex(" ", 2)[:9] for row in beyond] == ["7fff 8000"] * 3


@pytest.mark.parametrize("counters", [(0xFFFE, 0xFFFF, 0x10000), (0xFFFF, 0), (7, 30), (0,)])
def test_a_higher_counter_is_a_new_reading(reader: ImuReader, counters: tuple[int, ...]) -> None:
    for k, counter in enumerate(counters):
        reader.absorb(frames(counter), 1000 * k)
        assert reader.arrived_us == 1000 * k


@pytest.mark.parametrize("counters", [(7, 9, 8), (7, 8, 0x4008), (0, 1, 0xFFFF)])
def test_an_older_or_far_off_sample_is_ignored(reader: ImuReader, counters: tuple[int, ...]) -> None:
    for k, counter in enumerate(counters):
        reader.absorb(frames(counter, gyro=0.1 * k), 1000 * k)
    assert (reader.arrived_us, reader.reading.gyro[0]) == (1000, pytest.approx(0.1))


@pytest.mark.parametrize("before", [1, 2, 3])
def test_a_part_has_the_time_of_its_frames_arrival(reader: ImuReader, before: int) -> None:
    """A queued frame is older than its counter suggests."""
    for counter in range(before):
        reader.absorb(frames(counter), 1000 * counter)
    reader.absorb(frames(before, arrived_us=np.array([40_700, 40_500, 40_600])), 90_000)
    assert (reader.arrived_us, reader.oldest) == (40_500, "acceleration")
