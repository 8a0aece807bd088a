"""The modes of the control loop."""

from enum import StrEnum


class Mode(StrEnum):
    """What the loop does. In IDLE the motors are off, or being enabled."""

    IDLE = "IDLE"
    CHECKING = "CHECKING"  # one joint after the other moves a little, to find wrong wiring
    STANDING = "STANDING"
    WALKING = "WALKING"
    STOPPING = "STOPPING"  # the policy walks on until the robot stands still
    LOWERING = "LOWERING"  # the robot lies down before its motors are disabled
    RELEASING = "RELEASING"  # damping at the end of a run
    FALLING = "FALLING"  # damping; latched, unless the robot may get up
    RECOVERING = "RECOVERING"  # a get-up policy decides, after a fall
    ESTOP = "ESTOP"  # damping, latched


DAMPED = (Mode.RELEASING, Mode.FALLING, Mode.ESTOP)
DECIDING = (Mode.WALKING, Mode.STOPPING)  # the policy that walks decides
COMMANDED = (*DECIDING, Mode.RECOVERING)  # some policy decides
MOVING = (Mode.STANDING, *DECIDING)
UPRIGHT = (Mode.CHECKING, *MOVING, Mode.LOWERING)  # a robot that tips over has fallen
HELD = (*UPRIGHT, Mode.RECOVERING)  # joints have stiffness
