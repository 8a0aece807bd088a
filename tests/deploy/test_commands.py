"""Commands stay within the ranges of the training; the modes that an operator sees."""

import numpy as np
import pytest

from footfall.deploy.command_source import UNKNOWN_POSE, Offer, Status
from footfall.deploy.commands import CommandLimits
from footfall.deploy.field_mode import FieldMode, field_mode
from footfall.deploy.modes import DAMPED, Mode
from footfall.robots.commands import CommandRange

RANGES = CommandRange((-1.0, 1.5), (-0.5, 0.5), (-1.0, 1.0))


def test_commands_are_clipped_axis_by_axis() -> None:
    for requested, given in (
        ([1.5, -0.5, 1.0], [1.5, -0.5, 1.0]),
        ([5.0, 0.0, 0.0], [1.5, 0.0, 0.0]),
        ([-5.0, 3.0, -2.0], [-1.0, 0.5, -1.0]),
        ([1e300, 0.0, 0.0], [1.5, 0.0, 0.0]),
        ([np.nan, np.inf, 0.3], [0.0, 0.0, 0.3]),
    ):
        assert CommandLimits(RANGES).apply(np.array(requested)).tolist() == given


def test_each_clipped_axis_is_noted_once_and_the_requested_command_stays_unchanged() -> None:
    limits, requested = CommandLimits(RANGES), np.array([5.0, 0.0, 0.0])
    for forward in (1.0, 5.0, 6.0, -7.0):
        requested[0] = forward
        limits.apply(requested)
        assert requested.tolist() == [forward, 0.0, 0.0]
    limits.apply(np.array([0.0, 0.0, 1.1]))
    forward_note, yaw_note = limits.notes
    assert all(word in forward_note for word in ("forward", "-1 to 1.5", "5 was clipped to 1.5"))
    assert all(word in yaw_note for word in ("yaw", "-1 to 1", "1.1 was clipped to 1"))


@pytest.mark.parametrize("mode", Mode)
def test_every_mode_of_the_supervisor_has_a_mode_for_operators(mode: Mode) -> None:
    """A status shows whether a fault ended the run."""
    person, program = (field_mode(mode, False, autonomous) for autonomous in (False, True))
    if mode is Mode.WALKING:
        assert (person, program) == (FieldMode.TELEOPERATION, FieldMode.AUTONOMOUS)
    else:
        assert person is program
    recovers = mode is Mode.RECOVERING  # which begins with a fall
    after_fault = FieldMode.RECOVERING if recovers else FieldMode.FAULT
    assert field_mode(mode, True, False) is after_fault
    if mode in (Mode.FALLING, Mode.ESTOP):
        assert person is FieldMode.FAULT
    elif mode in (*DAMPED, Mode.STOPPING, Mode.LOWERING):
        assert person is FieldMode.ENDING
    still = np.zeros(3)
    for faults, expected in ((["a fault"], after_fault), ([], program)):
        status = Status(9.0, 0.0, mode, "trot", still, still, 0.0, UNKNOWN_POSE, faults, [], Offer())
        assert status.field_mode is expected
