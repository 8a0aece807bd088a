"""The modes that operators know."""

import pytest

from footfall.deploy.field_mode import FieldMode, field_mode
from footfall.deploy.modes import DAMPED, Mode


@pytest.mark.parametrize("mode", Mode)
def test_every_mode_of_the_supervisor_is_one_of_the_operators(mode: Mode) -> None:
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
