"""What can be changed while a robot walks. Each setting is declared once: its unit, and who may change it.

A policy that has such settings is `Steerable`. It says which it has, with the range and the default that hold
for its robot, and approaches a new value so that no joint target jumps.
"""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple, Protocol, runtime_checkable


class Access(StrEnum):
    """Who may change a setting."""

    OWNER = "owner"  # whoever steers the robot
    ANYONE = "anyone"  # every authorised operator: it can only make the robot slower


class Declaration(NamedTuple):
    """A setting, whichever policy has it."""

    about: str
    unit: str
    access: Access = Access.OWNER


DECLARED = {
    "step_period_s": Declaration("time of one gait cycle", "s"),
    "step_height_m": Declaration("height of a foot in the middle of its swing", "m"),
    "step_length_m": Declaration("longest way of a foot in one stance", "m"),
    "body_height_m": Declaration("height of the base above the ground", "m"),
    "roll_rad": Declaration("roll of the base", "rad"),
    "pitch_rad": Declaration("pitch of the base, nose down positive", "rad"),
}


class Span(NamedTuple):
    """Range and default of a setting of one policy on one robot, in the setting's unit."""

    lowest: float
    highest: float
    default: float


@runtime_checkable
class Steerable(Protocol):
    """A policy whose steps can be changed while it walks."""

    @property
    def live_settings(self) -> Mapping[str, Span]:
        """The settings that it has, by their names in `DECLARED`."""

    @property
    def gaits(self) -> Sequence[str]:
        """Names of the gaits that it can take up; empty if it has only one."""

    def set_live(self, values: Mapping[str, float]) -> None:
        """Approach new values, each within its range; a setting that is not named keeps its value."""

    def take_up(self, gait: str) -> None:
        """Change to one of its gaits at the next moment that allows it."""
