"""Settings that can change while a robot walks. Each is declared once: its unit, and who may change it.

A policy with such settings is `Steerable`. It lists its settings with their ranges and defaults for its
robot, and changes a value gradually, so that no joint target jumps.
"""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import NamedTuple, Protocol, runtime_checkable

from footfall.common.errors import UserError


class Access(StrEnum):
    """Who may change a setting."""

    OWNER = "owner"  # the operator that steers the robot
    ANYONE = "anyone"  # every authorised operator: the setting can only slow the robot down


class Declaration(NamedTuple):
    """Declaration of a setting, independent of the policy."""

    about: str
    unit: str
    access: Access = Access.OWNER


DECLARED = {
    "step_period_s": Declaration("period of the gait cycle", "s"),
    "step_height_m": Declaration("height of a foot at mid-swing", "m"),
    "step_length_m": Declaration("longest travel of a foot in one stance", "m"),
    "body_height_m": Declaration("height of the base above the ground", "m"),
    "roll_rad": Declaration("roll of the base", "rad"),
    "pitch_rad": Declaration("pitch of the base, nose down positive", "rad"),
}


class Span(NamedTuple):
    """Range and default of a setting for one policy on one robot, in the setting's unit."""

    lowest: float
    highest: float
    default: float


class Applied(NamedTuple):
    """Gait and settings that a policy uses now. They follow a request gradually."""

    gait: str = ""  # empty for a policy without a choice of gaits
    settings: Mapping[str, float] = {}  # by name in `DECLARED`, in its unit


NOTHING_APPLIED = Applied()

# Lowest and highest value of a setting, as shares of the controller's own value.
RANGES = {
    "step_period_s": (0.75, 1.6),
    "step_height_m": (0.3, 1.5),
    "step_length_m": (0.2, 1.0),
    "body_height_m": (0.8, 1.05),
}


def spans_around(defaults: Mapping[str, float]) -> dict[str, Span]:
    """Spans of settings around a controller's own values."""
    return {
        name: Span(RANGES[name][0] * value, RANGES[name][1] * value, value)
        for name, value in defaults.items()
    }


def moved_towards(value: float, goal: float, max_change: float) -> float:
    """A value moved towards its goal by at most `max_change`."""
    return value + min(max(goal - value, -max_change), max_change)


def require_steerable(policy: object, name: str) -> None:
    """Check that a policy with live settings implements all of `Steerable`.

    Raises:
        UserError: a member is missing.
    """
    missing = [part for part in ("live_settings", "gaits", "applied", "take_up") if not hasattr(policy, part)]
    if hasattr(policy, "set_live") and missing:
        raise UserError(
            f"policy '{name}' has set_live, but not {', '.join(missing)}: see live_settings.Steerable"
        )


def applied_of(policy: object) -> Applied:
    """Gait and settings that a policy uses now; empty if it is not `Steerable`."""
    applied: Applied = getattr(policy, "applied", NOTHING_APPLIED)
    return applied


@runtime_checkable
class Steerable(Protocol):
    """A policy whose gait can be changed while it walks."""

    @property
    def live_settings(self) -> Mapping[str, Span]:
        """Settings available with the current gait, by name in `DECLARED`."""

    @property
    def gaits(self) -> Sequence[str]:
        """Names of the gaits to which it can change; empty if it has only one."""

    @property
    def applied(self) -> Applied:
        """Gait and values that act now; read at each step."""

    def set_live(self, values: Mapping[str, float]) -> None:
        """Approach new values, each within its range; a setting without a new value stays."""

    def take_up(self, gait: str) -> None:
        """Change to one of its gaits as soon as possible."""
