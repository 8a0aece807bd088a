"""MIT-mode frames: which bits mean what, and what happens at the edges."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from footfall.common.errors import UserError
from footfall.deploy.drivers import mit
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.wiring import wire
from footfall.robots.description import Robot

PROTOCOLS = list(mit.RANGES)
CODEC = mit.Codec(PROTOCOLS)
N = len(PROTOCOLS)
EVERYONE = np.arange(N)
shares = arrays.arrays(float, (5, N), elements=st.floats(0.0, 1.0))
anything = arrays.arrays(float, (5, N), elements=st.floats(-1e9, 1e9))


def decoded(data: np.ndarray) -> np.ndarray:
    return CODEC.decode(mit.words(data), EVERYONE)


def replies(values: np.ndarray, tail: int = 0) -> np.ndarray:
    head = np.arange(1, N + 1, dtype=np.uint64) << np.uint64(56)
    return CODEC.encode_replies(EVERYONE, head, values, np.full(N, tail, dtype=np.uint64))


class TestCommandFrames:
    def test_fields_lie_where_the_manual_puts_them(self) -> None:
        codec = mit.Codec(["AK80-9"])
        # lowest position, highest velocity, lowest stiffness, highest damping, lowest torque
        values = np.array([[-12.5], [50.0], [0.0], [5.0], [-18.0]])
        assert codec.encode(values)[0].tobytes().hex(" ") == "00 00 ff f0 00 ff f0 00"

    def test_scaling_is_2_to_the_n_minus_1_in_both_directions(self) -> None:
        codec = mit.Codec(["AK80-9"])
        middle = codec.encode(np.zeros((5, 1)))[0]
        assert int.from_bytes(middle[:2].tobytes(), "big") == 0x8000  # 32767.5, to even
        assert codec.lowest[:, 0].tolist() == [-12.5, -50.0, 0.0, 0.0, -18.0]
        assert codec.highest[:, 0].tolist() == [12.5, 50.0, 500.0, 5.0, 18.0]
        assert codec.quantum[0, 0] == 25.0 / 65535
        assert codec.quantum[1, 0] == 100.0 / 4095

    @given(shares)
    def test_a_round_trip_is_off_by_half_a_quantum_at_most(self, share: np.ndarray) -> None:
        values = CODEC.lowest + share * (CODEC.highest - CODEC.lowest)
        data = CODEC.encode(values)
        error = np.abs(decoded(data) - values)
        lowered = mit.words(data) == mit.ENTER - 1  # would have read as a special frame, see below
        assert np.all((error <= 0.5 * CODEC.quantum * (1 + 1e-9)) | lowered)

    @given(anything)
    def test_values_out_of_range_are_clamped_and_never_wrap(self, values: np.ndarray) -> None:
        clamped = np.clip(values, CODEC.lowest, CODEC.highest)
        assert np.array_equal(CODEC.encode(values), CODEC.encode(clamped))

    def test_no_command_reads_as_a_special_frame(self) -> None:
        word = mit.words(CODEC.encode(CODEC.highest * 2))
        assert (word < mit.ENTER).all()
        back = decoded(CODEC.encode(CODEC.highest * 2))
        np.testing.assert_allclose(back, CODEC.highest, atol=5 * CODEC.quantum.max())

    @pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
    def test_what_is_not_finite_is_refused(self, bad: float) -> None:
        values = np.zeros((5, N))
        values[3, 2] = bad
        with pytest.raises(ValueError, match="not finite"):
            CODEC.encode(values)


class TestSpecialFrames:
    @pytest.mark.parametrize(("word", "last"), [(mit.ENTER, 0xFC), (mit.EXIT, 0xFD), (mit.ZERO, 0xFE)])
    def test_are_seven_ff_and_a_code(self, word: int, last: int) -> None:
        assert mit.special(word, 2).tolist() == [[0xFF] * 7 + [last]] * 2


class TestReplies:
    def test_fields_lie_where_the_manual_puts_them(self) -> None:
        codec = mit.Codec(["AK80-9"])
        data = codec.encode_replies(
            np.array([0]),
            np.array([7 << 56], dtype=np.uint64),
            np.array([[12.5], [-50.0], [18.0]]),
            np.array([40 << 8 | 3], dtype=np.uint64),
        )
        assert data[0].tobytes().hex(" ") == "07 ff ff 00 0f ff 28 03"
        reply = codec.decode_replies(data, np.array([0]))
        assert (reply.temperature_c[0], reply.error[0]) == (40, 3)

    @given(shares)
    def test_a_round_trip_is_off_by_half_a_quantum_at_most(self, share: np.ndarray) -> None:
        lowest, highest = CODEC.lowest[[0, 1, 4]], CODEC.highest[[0, 1, 4]]
        values = lowest + share[:3] * (highest - lowest)
        back = CODEC.decode_replies(replies(values), EVERYONE).values
        assert np.all(np.abs(back - values) <= 0.5 * CODEC.reply_quantum * (1 + 1e-9))

    @pytest.mark.parametrize(("factor", "code"), [(2.0, "ff ff ff ff ff"), (-2.0, "00 00 00 00 00")])
    def test_readings_out_of_range_are_clamped_and_never_wrap(self, factor: float, code: str) -> None:
        data = replies(factor * CODEC.highest[[0, 1, 4]], tail=40 << 8)
        assert data[0].tobytes().hex(" ") == f"01 {code} 28 00"

    def test_a_short_reply_of_six_bytes_is_read_too(self) -> None:
        data = replies(np.ones((3, N)), tail=99)
        short = data.copy()
        short[:, 6:] = 0  # as the bus pads it
        full, brief = (CODEC.decode_replies(d, EVERYONE) for d in (data, short))
        assert np.array_equal(full.values, brief.values)
        assert not brief.error.any()


def test_an_unknown_motor_is_named_with_the_known_ones() -> None:
    with pytest.raises(UserError, match=r"no MIT-mode motor 'AK47'.*AK80-9"):
        mit.Codec(["AK47"])


def test_a_motor_of_another_protocol_is_refused_with_its_joint(go1: Robot) -> None:
    """Damiao's replies are laid out differently; nothing here reads them yet."""
    wiring = wire(go1)
    with pytest.raises(UserError, match=r"joint FR_hip_joint: no driver for motor 'DM8009': .*AK80-9"):
        open_driver(replace(wiring, models=("DM8009", *wiring.models[1:])))


def test_a_motor_id_that_a_frame_cannot_carry_is_refused_with_its_joint(go1: Robot) -> None:
    wiring = wire(go1)
    with pytest.raises(UserError, match=r"joint FR_hip_joint has motor id 128: MIT mode takes 1 to 127"):
        open_driver(replace(wiring, motor_id=np.array([128, *wiring.motor_id[1:]])))
