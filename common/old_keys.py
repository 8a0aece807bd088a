"""Keys that settings files had in earlier versions: files with these keys still load."""

from collections.abc import Sequence
from typing import Any

# Old key to current key, after its parent's key and a dot where the key alone could belong to something else.
# A key of a file's top level begins with the dot.
CURRENT_KEYS = {
    "inertia_doubt": "inertia_uncertainty",
    "least_height_share": "min_height_share",
    "least_leg_share": "min_leg_share",
    "least_rad": "min_rad",
    "least_share": "min_share",
    "least_swing_s": "min_swing_s",
    "most_attitude_rad": "max_attitude_rad",
    "most_force": "max_force",
    "most_force_n": "max_force_n",
    "most_lead_m": "max_lead_m",
    "most_off_m": "max_offset_m",
    "most_position_lead_m": "max_position_lead_m",
    "most_rad": "max_rad",
    "most_step_m": "max_step_m",
    "most_tilt_rad": "max_tilt_rad",
    "most_yaw_lead_rad": "max_yaw_lead_rad",
    "no_solution.most_s": "max_s",
    "contact.damping_s": "damping",
    "battery.off_cell_v": "max_cell_deviation_v",
    "recovery.again_s": "same_fall_s",
    "recovery.asked": "on_request",
    "sensors.ignored": "commands_ignored",
    "sensors.ignored_s": "commands_ignored_s",
    "sensors.lean_error": "lateral_error",
    "sensors.limp_s": "no_torque_s",
    "sensors.long_lean_error": "long_lateral_error",
    "sensors.long_lean_memory_s": "long_lateral_memory_s",
    "slope.ignored": "deadband",
    "slope.most": "max_gradient",
    "start.most_s": "max_s",
    ".back_to": "backoff",
    ".most": "max_gain",
}


def current_key(key: Sequence[str]) -> tuple[str, ...]:
    """A key after those of its parents, of which the outermost may be missing, under current names."""
    return tuple(map(_current, key, (None, *key)))


def with_current_keys(data: Any, parent: str = "") -> Any:
    """Plain data under current keys. An old key beside its new one stays, and is refused later as unknown."""
    if isinstance(data, list):
        return [with_current_keys(item, parent) for item in data]
    if not isinstance(data, dict):
        return data
    new = {}
    for key, value in data.items():
        current = _current(key, parent)
        new[key if current in data else current] = with_current_keys(value, str(key))
    return new


def _current(key: Any, parent: str | None) -> Any:
    return CURRENT_KEYS.get(f"{parent}.{key}", CURRENT_KEYS.get(key, key))
