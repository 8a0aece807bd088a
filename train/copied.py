"""A preset's file that was copied from one that ships with footfall, and edited."""

from typing import Any

from footfall.common.config import by_label

_ABSENT = object()


def adapted_copy(copy: Any, shipped: Any, adapted: Any) -> Any:
    """The copy's settings, with the robot's own wherever the copy equals the shipped file.

    Args:
        copy: plain data of the file; settings that its user changed, added or left out win.
        shipped: plain data of the original.
        adapted: the original with the robot's own settings in it.
    """
    if copy == shipped:
        return adapted
    if _is_terms(copy) and _is_terms(shipped) and _is_terms(adapted):
        merged = adapted_copy(by_label(copy), by_label(shipped), by_label(adapted))
        return list(merged.values())
    if not (isinstance(copy, dict) and isinstance(shipped, dict) and isinstance(adapted, dict)):
        return copy
    combined = {
        key: adapted_copy(
            copy.get(key, _ABSENT), shipped.get(key, _ABSENT), adapted.get(key, shipped.get(key, _ABSENT))
        )
        for key in copy | adapted
    }
    return {key: value for key, value in combined.items() if value is not _ABSENT}


def differences(copy: Any, shipped: Any) -> int:
    """Number of settings in which two presets differ."""
    if _is_terms(copy) and _is_terms(shipped):
        copy, shipped = by_label(copy), by_label(shipped)
    if isinstance(copy, dict) and isinstance(shipped, dict):
        return sum(differences(copy.get(key, _ABSENT), shipped.get(key, _ABSENT)) for key in copy | shipped)
    return int(copy != shipped)


def _is_terms(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(each, dict) for each in value)
