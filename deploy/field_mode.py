"""Modes of a run for operators, derived from the supervisor's modes."""

from enum import StrEnum

from footfall.deploy.modes import Mode


class FieldMode(StrEnum):
    """State of a run in an operator's terms."""

    OFF = "off"
    CALIBRATING = "calibrating"  # wiring check and standing up: steering is not possible yet
    TELEOPERATION = "teleoperation"  # a person steers
    AUTONOMOUS = "autonomous"  # a program steers: a mission, a fixed command, a scenario
    RECOVERING = "recovering"  # after a fall it gets up, with an operator's consent
    ENDING = "ending"  # stops, lies down and is damped on request
    FAULT = "fault"  # latched: it lies down or is damped, and only a new run clears the fault


STEERED = FieldMode.TELEOPERATION  # or autonomous
TABLE = {  # with a fault every mode is FAULT, except IDLE before a run and RECOVERING
    Mode.IDLE: FieldMode.OFF,
    Mode.CHECKING: FieldMode.CALIBRATING,
    Mode.STANDING: FieldMode.CALIBRATING,
    Mode.WALKING: STEERED,
    Mode.STOPPING: FieldMode.ENDING,
    Mode.LOWERING: FieldMode.ENDING,
    Mode.RELEASING: FieldMode.ENDING,
    Mode.FALLING: FieldMode.FAULT,
    Mode.RECOVERING: FieldMode.RECOVERING,
    Mode.ESTOP: FieldMode.FAULT,
}


def field_mode(mode: Mode, faulty: bool, autonomous: bool) -> FieldMode:
    """Mode for operators from the supervisor's mode.

    Args:
        mode: mode of the supervisor.
        faulty: whether the supervisor has found a fault.
        autonomous: whether a program steers, instead of a person.
    """
    found = TABLE[mode]
    if faulty and found is not FieldMode.RECOVERING:  # RECOVERING begins with a fall
        return FieldMode.FAULT
    return FieldMode.AUTONOMOUS if found is STEERED and autonomous else found
