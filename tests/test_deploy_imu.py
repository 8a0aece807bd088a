"""IMU readings as CAN frames."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footfall.common.rotations import shift_gravity
from footfall.deploy.drivers import imu
from footfall.deploy.frames import Frames

vectors = st.lists(st.floats(-30.0, 30.0), min_size=3, max_size=3)


def gravity(quaternion: list[float]) -> np.ndarray:
    w, x, y, z = quaternion
    return np.array([2 * (w * y - x * z), -2 * (w * x + y * z), 2 * (x * x + y * y) - 1.0])


@given(vectors, vectors)
def test_a_reading_survives_within_half_a_unit(gyro: list[float], acceleration: list[float]) -> None:
    frames = imu.encode(imu.Inertial(gyro, acceleration, [0.6, 0.0, -0.8, 0.0]), 70000)
    back, counter = imu.decode_gyro(frames[0].tobytes())
    assert counter == 70000 % 65536
    np.testing.assert_allclose(back, gyro, atol=0.5 * imu.GYRO_UNIT + 1e-12)
    np.testing.assert_allclose(
        imu.decode_acceleration(frames[1].tobytes()), acceleration, atol=0.5 * imu.ACCELERATION_UNIT + 1e-12
    )
    quaternion = imu.decode_quaternion(frames[2].tobytes())
    assert quaternion is not None
    np.testing.assert_allclose(quaternion, [0.6, 0.0, -0.8, 0.0], atol=1e-4)
    assert np.linalg.norm(quaternion) == pytest.approx(1.0, abs=1e-12)


def test_readings_past_the_range_are_clamped_and_never_wrap() -> None:
    frames = imu.encode(imu.Inertial([1e3, -1e3, 0.0], [1e4, 0.0, -1e4], [1.0, 0.0, 0.0, 0.0]), 0)
    assert imu.decode_gyro(frames[0].tobytes())[0] == pytest.approx((32.767, -32.768, 0.0))
    assert imu.decode_acceleration(frames[1].tobytes())[0] == pytest.approx(163.835)


def test_a_quaternion_of_zeros_is_no_rotation() -> None:
    assert imu.decode_quaternion(bytes(8)) is None


def test_a_gravity_offset_moves_the_projected_gravity_as_declared() -> None:
    quaternion = [0.9, 0.1, -0.2, 0.3]
    quaternion = [q / np.linalg.norm(quaternion) for q in quaternion]
    offset = [0.02, -0.03, 0.01]
    wanted = gravity(quaternion) + offset
    np.testing.assert_allclose(
        gravity(shift_gravity(quaternion, offset)), wanted / np.linalg.norm(wanted), atol=1e-12
    )


def test_a_whole_reading_is_read_alike_at_once_and_frame_by_frame() -> None:
    """The second batch from the same arrays takes the short way."""
    reader = imu.ImuReader(channel=1)
    channel, identifier, length = np.full(3, 1), np.array(imu.IDS), np.full(3, 8)
    for counter, scale in ((1, 1.0), (2, -2.0)):
        gyro, acceleration = [0.1 * scale, 0.2, 0.3], [1.0, 2.0 * scale, 9.0]
        data = imu.encode(imu.Inertial(gyro, acceleration, [0.8, 0.0, 0.6, 0.0]), counter)
        reader.absorb(Frames(channel, identifier, data, length), 1000 * counter)
        np.testing.assert_allclose(reader.reading.gyro, gyro, atol=1e-3)
        np.testing.assert_allclose(reader.reading.acceleration, acceleration, atol=5e-3)
        np.testing.assert_allclose(reader.reading.quaternion, [0.8, 0.0, 0.6, 0.0], atol=1e-4)
        assert reader.heard_us == 1000 * counter


def test_an_imu_is_heard_once_each_kind_of_frame_has_come() -> None:
    reader = imu.ImuReader(channel=1)
    data = imu.encode(imu.Inertial([0.1, 0.2, 0.3], [0.0, 0.0, 9.8], [1.0, 0.0, 0.0, 0.0]), 1)
    one, heard = np.ones(1, int), []
    for kind in (0, 2, 1):
        reader.absorb(Frames(one, np.array([imu.IDS[kind]]), data[[kind]], np.full(1, 8)), 1000 + kind)
        heard.append(reader.heard_us)
    assert heard == [None, None, 1000]  # the counter is in the gyro's frame


def test_an_imu_on_another_bus_is_not_listened_to() -> None:
    reader = imu.ImuReader(channel=1)
    channel, identifier, length = np.full(3, 0), np.array(imu.IDS), np.full(3, 8)
    for counter in (1, 2):  # the second time from arrays that were seen before
        data = imu.encode(imu.Inertial([1.0, 0.0, 0.0], [0.0, 0.0, 9.8], [1.0, 0.0, 0.0, 0.0]), counter)
        reader.absorb(Frames(channel, identifier, data, length), 1000 * counter)
    assert reader.heard_us is None
    assert reader.reading.gyro == (0.0, 0.0, 0.0)


def test_a_reading_that_is_no_number_does_not_stop_the_simulation() -> None:
    frames = imu.encode(imu.Inertial([np.nan, 0.0, 0.0], [0.0, 0.0, 9.8], [1.0, 0.0, 0.0, 0.0]), 1)
    assert imu.decode_gyro(frames[0].tobytes())[0][0] == pytest.approx(32.767)
