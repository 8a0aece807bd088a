"""Fields of a request that arrives as JSON, and checks of their values."""

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np

from footfall.common.limits import MAX_COMMAND
from footfall.deploy.command_source import Behaviour, Offer
from footfall.policies.live_settings import DECLARED

MAX_NAME_CHARS = 80  # maximum length of an operator's name or a stop's reason
MAX_SETTING = 1e6  # absolute value of any setting, in its unit
FIELDS = ("velocity", "behaviour", "policy", "gait", "settings")  # arguments of `Inbox.put`
FORMER_FIELDS = {"wish": "behaviour"}  # former names, still accepted


def request_fields(message: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a message that are arguments of `Inbox.put`."""
    named = {FORMER_FIELDS.get(key, key): value for key, value in message.items()}
    return {key: value for key, value in named.items() if key in FIELDS}


def name_refusal(operator: Any) -> str:
    """Why this cannot be an operator's name; empty if it can."""
    valid = isinstance(operator, str) and 0 < len(operator) <= MAX_NAME_CHARS and operator.isprintable()
    return "" if valid else f"an operator's name is a line of 1 to {MAX_NAME_CHARS} characters"


def checked_velocity(value: Any) -> np.ndarray:
    """A velocity (3,) from a sequence of numbers.

    Raises:
        ValueError: it has another form, is not finite, or is beyond any robot.
    """
    values = list(value) if isinstance(value, list | tuple | np.ndarray) else []
    numbers: list[Any] = [each for each in values if isinstance(each, Real) and not isinstance(each, bool)]
    if len(values) != 3 or len(numbers) != 3:
        raise ValueError("a velocity is three numbers: forward m/s, leftward m/s, yaw rad/s")
    if any(abs(each) > MAX_COMMAND for each in numbers):
        raise ValueError(f"a velocity beyond {MAX_COMMAND:g} m/s or rad/s is refused")
    velocity = np.array(numbers, dtype=float)
    if not np.isfinite(velocity).all():
        raise ValueError("a velocity that is not finite is refused")
    return velocity


def checked_behaviour(value: Any) -> Behaviour:
    """A behaviour from its text.

    Raises:
        ValueError: there is no such behaviour.
    """
    try:
        return Behaviour(value)
    except ValueError:
        raise ValueError(f"behaviour is one of {', '.join(Behaviour)}") from None


def checked_name(kind: str, name: Any, known: Any) -> str:
    """The name of a policy or a gait; empty for no change.

    Raises:
        ValueError: it is not a name, or not a known one.
    """
    if not isinstance(name, str) or len(name) > MAX_NAME_CHARS:
        raise ValueError(f"a {kind} must be a name")
    if known is not None and name not in ("", *known):
        raise ValueError(f"there is no {kind} '{name}' here: {', '.join(known) or 'none can be chosen'}")
    return name


def checked_settings(value: Any, offer: Offer | None) -> dict[str, float]:
    """Live settings by name, those of an offer if there is one.

    Raises:
        ValueError: a setting is not offered, or its value is not a number.
    """
    if not isinstance(value, Mapping):
        raise ValueError("settings are numbers by name")
    known = DECLARED if offer is None else offer.settings
    settings = {}
    for name, number in value.items():
        if not isinstance(name, str) or name not in known or name not in DECLARED:
            shown = str(name)[:MAX_NAME_CHARS]
            raise ValueError(
                f"there is no setting '{shown}' here: {', '.join(known) or 'none can be changed'}"
            )
        is_number = isinstance(number, int | float) and not isinstance(number, bool)
        if not is_number or not abs(number) < MAX_SETTING:  # rejects NaN, too
            raise ValueError(f"{name} is a number, in {DECLARED[name].unit}")
        settings[name] = float(number)
    return settings
