"""What a frame costs on the wire."""

import math

import pytest

from footfall.deploy.frames import frame_bits


class TestFrameBits:
    @pytest.mark.parametrize(
        ("length", "extended", "stuffed", "bits"),
        [
            (8, False, False, 111),
            (8, False, True, 135),
            (8, True, False, 131),
            (8, True, True, 160),
            (0, False, True, 55),  # 34 bits that may be stuffed: at most 8 more
            (3, False, True, 85),  # 58: 14 more, the first after five
            (7, True, True, 150),
            (0, True, False, 67),
        ],
    )
    def test_known_figures(self, length: int, extended: bool, stuffed: bool, bits: int) -> None:
        assert frame_bits(length, extended, stuffed) == bits

    def test_a_frame_counts_its_most_stuff_bits_unless_told_otherwise(self) -> None:
        """Shorthand of ISO 11898: 47 + 8 n + floor((34 + 8 n - 1) / 4), and 67 and 54 with 29 bits."""
        for length in range(9):
            assert frame_bits(length) == 47 + 8 * length + math.floor((33 + 8 * length) / 4)
            assert frame_bits(length, True) == 67 + 8 * length + math.floor((53 + 8 * length) / 4)

    def test_twelve_motors_at_500_hz_need_two_buses(self) -> None:
        exchange_us = 2 * frame_bits(8)
        assert 6 * exchange_us * 500 / 1e6 == pytest.approx(0.81)
