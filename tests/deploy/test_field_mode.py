"""Operators' modes."""

import numpy as np
import pytest

from footfall.deploy.command_source import UNKNOWN_POSE, Offer, Status
from footfall.deploy.field_mode import FieldMode, field_mode
from footfall.deploy.modes import DAMPED, Mode

STILL = np.zeros(3)


@pytest.mark.parametrize("mode", Mode)
def test_every_mode_of_the_supervisor_has_a_mode_for_operators(mode: Mode) -> None:
    person, program = (field_mode(mode, False, autonomous) for autonomous in (False, True))
    if mode is Mode.WALKING:
        assert (person, program) == (FieldMode.TELEOPERATION, FieldMode.AUTONOMOUS)
    else:
        assert person is program
    recovers = mode is Mode.RECOVERING  # which begins with a fall
    assert field_mode(mode, True, False) is (FieldMode.RECOVERING if recovers else FieldMode.FAULT)
    if mode in (Mode.FALLING, Mode.ESTOP):
        assert person is FieldMode.FAULT
    elif mode in (*DAMPED, Mode.STOPPING, Mode.LOWERING):
        assert person is FieldMode.ENDING


def test_a_status_shows_that_a_fault_ended_the_run() -> None:
    status = Status(
        9.0, 0.0, Mode.LOWERING, "trot", STILL, STILL, 0.0, UNKNOWN_POSE, ["a fault"], [], Offer()
    )
    assert status.field_mode is FieldMode.FAULT
    assert status._replace(faults=[]).field_mode is FieldMode.ENDING
