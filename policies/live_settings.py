"""What can be changed while a robot walks. Each setting is declared once: its unit, and who may change it.

A policy that has such settings is `Steerable`. It says which it has, with the range and the default that hold
for its robot, and approaches a new value so that no joint target jumps.
"""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple, Protocol, runtime_checkable

from footfall.common.errors import UserError


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


class Applied(NamedTuple):
    """What a policy walks with now: a value that was asked for is approached, a gait waits for its moment."""

    gait: str = ""  # empty for a policy without a choice
    settings: Mapping[str, float] = {}  # by their names in `DECLARED`, in their units


NOTHING_APPLIED = Applied()

# Ranges as shares of a controller's own setting.
SHARES = {
    "step_period_s": (0.75, 1.6),
    "step_height_m": (0.3, 1.5),
    "step_length_m": (0.2, 1.0),
    "body_height_m": (0.8, 1.05),
}


def shared(defaults: Mapping[str, float]) -> dict[str, Span]:
    """Spans of settings about a controller's own values."""
    return {
        name: Span(SHARES[name][0] * value, SHARES[name][1] * value, value)
        for name, value in defaults.items()
    }


def approached(value: float, goal: float, most: float) -> float:
    """A value that is nearer to its goal by at most `most`."""
    return value + min(max(goal - value, -most), most)


def require_steerable(policy: object, name: str) -> None:
    """Refuse a policy that takes live settings and lacks a part of `Steerable`: it could not be steered.

    Raises:
        UserError: a part is missing.
    """
    lacks = [part for part in ("live_settings", "gaits", "applied", "take_up") if not hasattr(policy, part)]
    if hasattr(policy, "set_live") and lacks:
        raise UserError(
            f"policy '{name}' has set_live, but not {', '.join(lacks)}: see live_settings.Steerable"
        )


def applied_of(policy: object) -> Applied:
    """What a policy walks with now; nothing of one that is not `Steerable`."""
    applied: Applied = getattr(policy, "applied", NOTHING_APPLIED)
    return applied


@runtime_checkable
class Steerable(Protocol):
    """A policy whose steps can be changed while it walks."""

    @property
    def live_settings(self) -> Mapping[str, Span]:
        """The settings that it has with its present gait, by their names in `DECLARED`."""

    @property
    def gaits(self) -> Sequence[str]:
        """Names of the gaits that it can take up; empty if it has only one."""

    @property
    def applied(self) -> Applied:
        """The gait and the values that act now; asked for at each step."""

    def set_live(self, values: Mapping[str, float]) -> None:
        """Approach new values, each within its range; a setting that is not named keeps its value."""

    def take_up(self, gait: str) -> None:
        """Change to one of its gaits at the next moment that allows it."""
