"""MIT-mode frames: the meaning of their bits, and values at the ends of the ranges."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from some_motors import report

from footfall import Robot, UserError
from footfall.deploy.drivers import mit
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.mit_driver import MitDriver
from footfall.deploy.wiring import wiring_of
from footfall.plant.motor_ends.mit import MitMotorEnd

HIGHEST = {  # velocity rad/s, stiffness N m/rad, damping N m s/rad, torque N m; position 12.5 rad
    "AK80-9": (50.0, 500.0, 5.0, 18.0), "AK80-6": (76.0, 500.0, 5.0, 12.0),
    "AK70-10": (50.0, 500.0, 5.0, 25.0), "AK60-6": (50.0, 500.0, 5.0, 15.0),
    "AK10-9": (50.0, 500.0, 5.0, 65.0), "AK80-64": (8.0, 500.0, 5.0, 144.0),
    "MIT-40-150": (40.0, 500.0, 5.0, 150.0), "MIT-65-500": (65.0, 4000.0, 100.0, 500.0),
}  # fmt: skip
CODEC, N = mit.Codec(list(mit.RANGES)), len(mit.RANGES)
ALL = np.arange(N)
AK80_9 = mit.Codec(["AK80-9"])


def replies(values: np.ndarray, tail: int = 0, codec: mit.Codec = CODEC, first_id: int = 1) -> np.ndarray:
    motors = np.arange(values.shape[1])
    head = (first_id + motors).astype(np.uint64) << np.uint64(56)
    return codec.encode_replies(motors, head, values, np.full(len(motors), tail, dtype=np.uint64))


class TestCommandFrames:
    def test_fields_lie_where_the_manual_puts_them(self) -> None:
        # lowest position, highest velocity, lowest stiffness, highest damping, lowest torque
        values = np.array([[-12.5], [50.0], [0.0], [5.0], [-18.0]])
        assert AK80_9.encode(values)[0].tobytes().hex(" ") == "00 00 ff f0 00 ff f0 00"
        values[3] = 2.5  # half of its range
        assert AK80_9.encode(values)[0].tobytes().hex(" ") == "00 00 ff f0 00 80 00 00"

    @given(arrays.arrays(float, (5, N), elements=st.floats(0.0, 1.0)))
    def test_a_round_trip_is_off_by_half_a_quantum_at_most(self, share: np.ndarray) -> None:
        values = CODEC.lowest + share * (CODEC.highest - CODEC.lowest)
        data = CODEC.encode(values)
        error = np.abs(CODEC.decode(mit.words(data), ALL) - values)
        lowered = mit.words(data) == mit.ENTER - 1  # would be decoded as a special frame, see below
        assert np.all((error <= 0.5 * CODEC.quantum * (1 + 1e-9)) | lowered)

    def test_special_frames_are_seven_ff_and_a_code(self) -> None:
        for word, last in ((mit.ENTER, 0xFC), (mit.EXIT, 0xFD), (mit.ZERO, 0xFE)):
            assert mit.special(word, 2).tolist() == [[0xFF] * 7 + [last]] * 2


class TestReplies:
    def test_fields_lie_where_the_manual_puts_them(self) -> None:
        data = replies(np.array([[12.5], [-50.0], [18.0]]), 40 << 8 | 3, AK80_9, first_id=7)
        assert data[0].tobytes().hex(" ") == "07 ff ff 00 0f ff 28 03"
        reply = AK80_9.decode_replies(data, np.array([0]))
        assert (reply.temperature_c[0], reply.error[0]) == (40, 3)
        for factor, code in ((2.0, "ff ff ff ff ff"), (-2.0, "00 00 00 00 00")):  # clamped, never wrapped
            data = replies(factor * CODEC.highest[[0, 1, 4]], 40 << 8)
            assert data[0].tobytes().hex(" ") == f"01 {code} 28 00"

    def test_a_short_reply_of_six_bytes_is_read_too(self) -> None:
        data = replies(np.ones((3, N)), 99)
        short = data.copy()
        short[:, 6:] = 0  # as the bus pads it
        full, brief = (CODEC.decode_replies(each, ALL) for each in (data, short))
        assert np.array_equal(full.values, brief.values)
        assert not brief.error.any()


def test_ranges_and_errors_are_those_of_the_makers_manual(go1: Robot) -> None:
    assert {name: tuple(mit.Codec([name]).highest[1:, 0]) for name in mit.RANGES} == HIGHEST
    assert (CODEC.highest[0] == 12.5).all()
    driver = MitDriver(wiring_of(go1))
    known = ["over-temperature", "over-current", "over-voltage", "under-voltage", "encoder error"]
    assert [driver.error_name(code) for code in range(1, 7)] == [*known, "phase imbalance"]
    assert "timeout" in driver.error_name(MitMotorEnd.timeout_error)
    assert driver.error_name(99) == "error 99"


def test_a_replys_motor_is_known_by_its_bus_and_its_id_or_the_hosts(go1: Robot) -> None:
    """Motors 1 to 3 are on each of four buses: joint 4 is the second on bus 1. A foreign model is refused."""
    wiring, motors = wiring_of(go1), np.array([4, 1, 11, 7])
    driver, end = MitDriver(wiring), MitMotorEnd(wiring)
    sent = end.reply(motors, report(np.array([[0.1], [0.2], [0.3]]) * motors, temperature_c=35))
    assert (sent.channel.tolist(), sent.id.tolist()) == ([1, 0, 3, 2], [0x102, 0x102, 0x103, 0x102])
    found: Any = driver.replies(sent)
    assert (found.motor.tolist(), found.temperature_c.tolist()) == ([4, 1, 11, 7], [35] * 4)
    np.testing.assert_allclose(found.values[0], [0.4, 0.1, 1.1, 0.7], atol=2e-4)
    ids, lengths = np.array([0x000, 0x102, 0x102, 0x555]), np.array([8, 6, 5, 7])
    assert np.asarray(driver.replies(sent._replace(id=ids)).motor).tolist() == [4, 1]
    assert np.asarray(driver.replies(sent._replace(length=lengths)).motor).tolist() == [4, 1, 7]
    with pytest.raises(UserError, match=r"FR_hip_joint: .*'XY1'.*AK80-9.*DM8009"):
        open_driver(replace(wiring, models=("XY1", *wiring.models[1:])))
