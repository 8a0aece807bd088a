"""The modes that operators know, on top of the supervisor's."""

from enum import StrEnum

from footfall.deploy.modes import Mode


class FieldMode(StrEnum):
    """What a run is doing, in an operator's terms."""

    OFF = "off"
    CALIBRATING = "calibrating"  # wiring check and standing up: nobody steers yet
    TELEOPERATION = "teleoperation"  # a person steers
    AUTONOMOUS = "autonomous"  # a program steers: a mission, a fixed command, a scenario
    RECOVERING = "recovering"  # it fell, and gets up with an operator's consent
    ENDING = "ending"  # it stops, lies down and is damped, as asked for
    FAULT = "fault"  # latched: it lies down or is damped, and only a new run clears that


STEERED = FieldMode.TELEOPERATION  # or autonomous
TABLE = {  # with a fault every mode but IDLE before a run, and RECOVERING, is FAULT
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
    """The operator's mode of a run in one of the supervisor's.

    Args:
        mode: the supervisor's.
        faulty: whether it has found a fault.
        autonomous: whether a program steers, not a person.
    """
    found = TABLE[mode]
    if faulty and found is not FieldMode.RECOVERING:  # which begins with a fall
        return FieldMode.FAULT
    return FieldMode.AUTONOMOUS if found is STEERED and autonomous else found
