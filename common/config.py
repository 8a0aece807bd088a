"""YAML files to frozen dataclasses and back, with errors that name the field."""

import math
import re
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

import yaml
from cattrs import Converter, transform_error
from cattrs.errors import BaseValidationError, ForbiddenExtraKeysError
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn
from cattrs.v import format_exception

from footfall.common.errors import UserError
from footfall.common.files import is_named_pipe
from footfall.common.hints import no_setting
from footfall.common.old_keys import with_current_keys
from footfall.common.yaml_text import parse_yaml

T = TypeVar("T")

MAX_FILE_BYTES = 2**20  # largest file of settings that is read
MAX_VALUE_CHARS = 80  # characters of a refused value in a message
MAX_NAMED_FIELDS = 6  # fields that a message names for one reason

_converter = Converter(forbid_extra_keys=True, unstruct_collection_overrides={tuple: list})


# YAML 1.1, which PyYAML implements, reads a number of this form as text.
_EXPONENT_WITHOUT_POINT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")


def _shown(value: Any) -> str:
    """A refused value, shortened to fit a line."""
    text = repr(value)
    return text if len(text) <= MAX_VALUE_CHARS else f"{text[:MAX_VALUE_CHARS]}..."


def _structure_float(value: Any, _: type) -> float:
    if isinstance(value, str) and _EXPONENT_WITHOUT_POINT.fullmatch(value):
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{_shown(value)} is not a number")
    if not abs(value) <= sys.float_info.max:
        raise ValueError("not a finite number")
    return float(value)


def _structure_int(value: Any, _: type) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{_shown(value)} is not a whole number")
    return value


def _structure_str(value: Any, _: type) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{_shown(value)} is not text: put it in quotes")
    return value


def _structure_text_or_number(value: Any, _: type) -> str | float:
    return value if isinstance(value, str) else _structure_float(value, float)


def _structure_bool(value: Any, _: type) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{_shown(value)} is not true or false")
    return value


def _structure_choice(value: Any, choice: Any) -> Any:
    choices = get_args(choice)
    if value not in choices:
        raise ValueError(f"{_shown(value)} is none of {', '.join(map(str, choices))}")
    return value


_converter.register_structure_hook(float, _structure_float)
_converter.register_structure_hook(int, _structure_int)
_converter.register_structure_hook(str, _structure_str)
_converter.register_structure_hook(bool, _structure_bool)
_converter.register_structure_hook(str | float, _structure_text_or_number)
_converter.register_structure_hook_func(lambda cls: get_origin(cls) is Literal, _structure_choice)


def _reason(error: BaseException, expected: type | None) -> str:
    """Why one value was refused: the error's own message, if it has one."""
    if isinstance(error, ForbiddenExtraKeysError):
        return no_setting(sorted(map(str, error.extra_fields)), [field.name for field in fields(error.cl)])
    if isinstance(error, AttributeError | TypeError) and is_dataclass(expected):  # the value is not a mapping
        return "expected a mapping of settings"
    if type(error) in (ValueError, Exception) and str(error):
        return " ".join(str(error).split())
    return " ".join(format_exception(error, expected).split())


def _in_one_line(reasons: list[str]) -> str:
    """All reasons in one line; fields that are refused for the same reason share it."""
    fields_of: dict[str, list[str]] = {}
    for reason in map(_field_first, reasons):
        field, colon, why = reason.partition(": ")
        fields_of.setdefault(why if colon else reason, []).extend([field] if colon else [])
    return "; ".join(f"{_several(names)}: {why}" if names else why for why, names in fields_of.items())


def _several(names: list[str]) -> str:
    """Names as a list that fits a line."""
    more = len(names) - MAX_NAMED_FIELDS
    return ", ".join(names[:MAX_NAMED_FIELDS]) + (f" and {more} more" if more > 0 else "")


def _field_first(reason: str) -> str:
    """'why @ .field' as 'field: why'."""
    why, _, where = reason.rpartition(" @ ")
    return f"{where.lstrip('.')}: {why}" if where else why


def _joined(reason: str) -> str:
    """A reason to append to a field's name: 'low: why' becomes '.low: why', and 'why' becomes ': why'."""
    where, colon, _ = reason.partition(": ")
    return f".{reason}" if colon and " " not in where else f": {reason}"


def require_positive(config: Any, *names: str) -> None:
    """For a dataclass's own checks: raise ValueError unless these fields are finite and above 0.

    Every item of a tuple is checked; None passes. The same holds for the functions below.
    """
    _require(config, names, lambda value: 0 < value < math.inf, "must be above 0")


def require_not_negative(config: Any, *names: str) -> None:
    """Raise ValueError unless these fields are finite and 0 or above."""
    _require(config, names, lambda value: 0 <= value < math.inf, "must be 0 or above")


def require_between(config: Any, low: float, high: float, *names: str) -> None:
    """Raise ValueError unless these fields are in [low, high]."""
    _require(config, names, lambda value: low <= value <= high, f"must be from {low:g} to {high:g}")


def require_ordered(config: Any, *names: str) -> None:
    """Raise ValueError unless these fields are ranges (low, high) of finite numbers with low <= high."""
    for name in names:
        pair = getattr(config, name)
        if pair is not None and not -math.inf < pair[0] <= pair[1] < math.inf:
            raise ValueError(f"{name} must be a range from low to high, not {list(pair)}")


def _require(config: Any, names: tuple[str, ...], holds: Callable[[float], bool], rule: str) -> None:
    for name in names:
        value = getattr(config, name)
        for item in value if isinstance(value, tuple) else (value,):
            if item is not None and not holds(item):
                raise ValueError(f"{name} {rule}, not {item}")


def structure(data: Any, cls: type[T], source: str) -> T:
    """Build a dataclass from plain data.

    Raises:
        UserError: a field is missing, unknown or of the wrong type; the message names `source`
            and the field.
    """
    if data is None:
        data = {}
    if not isinstance(data, dict):
        raise UserError(f"{source}: expected a mapping of settings, found {type(data).__name__}")
    try:
        return _converter.structure(data, cls)
    except BaseValidationError as error:
        reasons = transform_error(error, path="", format_exception=_reason)
        raise UserError(f"{source}: {_in_one_line(reasons)}") from None
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise UserError(f"{source}: {' '.join(str(error).split())}") from None


def structure_value(data: Any, kind: Any, where: str) -> Any:
    """A value of any type from plain data.

    Raises:
        UserError: it is of another type, or not finite; the message begins with `where`.
    """
    try:
        return _converter.structure(data, kind)
    except BaseValidationError as error:
        reasons = transform_error(error, path="", format_exception=_reason)
        raise UserError("; ".join(f"{where}{_joined(_field_first(reason))}" for reason in reasons)) from None
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise UserError(f"{where}: {' '.join(str(error).split())}") from None


def takes_other_keys(rest: str) -> Callable[[type[T]], type[T]]:
    """Class decorator: YAML keys that are not fields of the dataclass are collected in its field `rest`."""

    def register(cls: type[T]) -> type[T]:
        names = {each.name for each in fields(cls)} - {rest}  # type: ignore[arg-type]
        structure_fields = make_dict_structure_fn(cls, _converter, _cattrs_forbid_extra_keys=True)
        unstructure_fields = make_dict_unstructure_fn(cls, _converter)

        def from_plain(data: Any, _: type) -> T:
            if not isinstance(data, dict):
                raise ValueError(f"expected a mapping of settings, found {_shown(data)}")
            known = {key: value for key, value in data.items() if key in names}
            others = {str(key): value for key, value in data.items() if key not in names}
            return structure_fields(known | {rest: others}, cls)

        def to_plain(config: T) -> dict[str, Any]:
            plain = unstructure_fields(config)
            return plain | plain.pop(rest)

        _converter.register_structure_hook(cls, from_plain)
        _converter.register_unstructure_hook(cls, to_plain)
        return cls

    return register


def unstructure(config: Any) -> Any:
    """A dataclass as plain data (dicts, lists, numbers, text)."""
    return _converter.unstructure(config)


def read_yaml(path: Path) -> Any:
    """Plain data of a YAML file, under current keys.

    Raises:
        UserError: the file cannot be read, is too large for settings, or is not YAML.
    """
    if is_named_pipe(path):
        raise UserError(f"{path} is a named pipe, which may block for ever: give a file")
    try:
        with path.open("rb") as file:
            content = file.read(MAX_FILE_BYTES + 1)  # limited: a device may never end
        if len(content) > MAX_FILE_BYTES:
            raise UserError(f"{path} holds no settings: it is larger than {MAX_FILE_BYTES:,} bytes")
        return with_current_keys(parse_yaml(content.decode()))
    except OSError as error:
        raise UserError(f"{path}: {error.strerror or error}") from None
    except ValueError as error:  # neither YAML nor text
        raise UserError(f"{path} is not valid YAML: {error}") from None


def merged(base: Any, changes: Any) -> Any:
    """Plain data with some of it replaced: mappings key by key, lists of terms by name, or as a whole."""
    if isinstance(base, list) and isinstance(changes, dict):
        return merged_terms(base, changes)
    if not isinstance(base, dict) or not isinstance(changes, dict):
        return changes
    return base | {key: merged(base.get(key), value) for key, value in changes.items()}


def merged_terms(listed: list[Any], changes: dict[str, Any]) -> list[Any]:
    """A list of terms with some settings replaced.

    Args:
        listed: mappings with a key "term"; a term is identified by its "name", if it has one.
        changes: settings by name; a number is a weight. A term that is not listed is added if its settings
            include "weight" or "term", and ignored otherwise.
    """
    given = {k: v if isinstance(v, dict) else {"weight": v} for k, v in changes.items()}
    labels = [_label(entry) for entry in listed]
    known = [merged(entry, given.get(label, {})) for entry, label in zip(listed, labels, strict=True)]
    for name, settings in given.items():
        if name not in labels and {"weight", "term"} & settings.keys():
            entry = {"term": name} | settings
            known.append(entry if _label(entry) == name else {"name": name} | entry)
    return known


def by_label(value: Any) -> Any:
    """A list of terms as a mapping by name; anything else unchanged."""
    return {_label(entry): entry for entry in value} if isinstance(value, list) else value


def _label(entry: Any) -> str:
    keys = ("name", "of", "term")  # a curriculum is identified by the section or event that it acts on
    found = next((entry[key] for key in keys if entry.get(key)), "") if isinstance(entry, dict) else ""
    return str(found).rpartition(":")[2]


def with_changes(base: Any, path: Path) -> Any:
    """Plain data, merged with a YAML file (see `merged`); an empty file changes nothing."""
    changes = read_yaml(path)
    return base if changes is None else merged(base, changes)


def load(path: Path, cls: type[T]) -> T:
    """Read a YAML file into a dataclass (see `read_yaml` and `structure` for errors)."""
    return structure(read_yaml(path), cls, str(path))


def dump(config: Any) -> str:
    """A dataclass as YAML text."""
    return yaml.safe_dump(unstructure(config), sort_keys=False)
