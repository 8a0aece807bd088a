"""Length of a frame on the wire."""

import math

import pytest

from footfall.deploy.frames import frame_bits


class TestFrameBits:
    @pytest.mark.parametrize("length", [0, 3, 8])
    def test_a_frame_counts_the_largest_number_of_stuff_bits(self, length: int) -> None:
        """The formula of ISO 11898 is 47 + 8 n + floor((34 + 8 n - 1) / 4), with 67 and 54 for 29 bits."""
        assert frame_bits(length) == 47 + 8 * length + math.floor((33 + 8 * length) / 4)
        assert frame_bits(length, True) == 67 + 8 * length + math.floor((53 + 8 * length) / 4)
