"""Commands stay within the ranges of the training, and a run notes when they were clipped."""

import numpy as np
import pytest

from footfall.deploy.commands import CommandLimits
from footfall.robots.commands import CommandRange

RANGES = CommandRange((-1.0, 1.5), (-0.5, 0.5), (-1.0, 1.0))


class TestLimits:
    @pytest.mark.parametrize(
        ("requested", "given"),
        [
            ([1.5, -0.5, 1.0], [1.5, -0.5, 1.0]),
            ([5.0, 0.0, 0.0], [1.5, 0.0, 0.0]),
            ([-5.0, 3.0, -2.0], [-1.0, 0.5, -1.0]),
            ([1e300, 0.0, 0.0], [1.5, 0.0, 0.0]),
            ([np.nan, np.inf, 0.3], [0.0, 0.0, 0.3]),
        ],
    )
    def test_commands_are_clipped_axis_by_axis(self, requested: list[float], given: list[float]) -> None:
        assert CommandLimits(RANGES).apply(np.array(requested)).tolist() == given

    def test_each_clipped_axis_is_noted_once_and_the_requested_command_stays_unchanged(self) -> None:
        limits, requested = CommandLimits(RANGES), np.array([5.0, 0.0, 0.0])
        for forward in (1.0, 5.0, 6.0, -7.0):
            requested[0] = forward
            limits.apply(requested)
            assert requested.tolist() == [forward, 0.0, 0.0]
        limits.apply(np.array([0.0, 0.0, 1.1]))
        forward_note, yaw_note = limits.notes
        assert all(word in forward_note for word in ("forward", "-1 to 1.5", "5 was clipped to 1.5"))
        assert all(word in yaw_note for word in ("yaw", "-1 to 1", "1.1 was clipped to 1"))
