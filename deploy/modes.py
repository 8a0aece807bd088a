"""Modes of the control loop."""

from enum import StrEnum


class Mode(StrEnum):
    """Mode of the loop. In IDLE the motors are disabled, or being enabled."""

    IDLE = "IDLE"
    CHECKING = "CHECKING"  # each joint moves slightly in turn, to find wrong wiring
    STANDING = "STANDING"
    WALKING = "WALKING"
    STOPPING = "STOPPING"  # the policy continues until the robot stands still
    LOWERING = "LOWERING"  # the robot lies down before its motors are disabled
    RELEASING = "RELEASING"  # damping at the end of a run
    FALLING = "FALLING"  # damping; latched, unless the robot may get up
    RECOVERING = "RECOVERING"  # a get-up policy decides, after a fall
    ESTOP = "ESTOP"  # damping, latched


DAMPED = (Mode.RELEASING, Mode.FALLING, Mode.ESTOP)
DECIDING = (Mode.WALKING, Mode.STOPPING)  # the walking policy decides
COMMANDED = (*DECIDING, Mode.RECOVERING)  # any policy decides
MOVING = (Mode.STANDING, *DECIDING)
UPRIGHT = (Mode.CHECKING, *MOVING, Mode.LOWERING)  # a robot that tips over has fallen
HELD = (*UPRIGHT, Mode.RECOVERING)  # joints have stiffness
