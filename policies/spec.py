"""Spec of a hand-written controller: its name, and changes of its settings.

    trot                             with the robot's own settings
    trot@mine.yaml                   with the settings in the file instead of the robot's
    trot@gait.period_s=0.5@kp=90     with these two settings instead of the robot's
    trot@mine.yaml@gait.period_s=0.5 with both

The spec holds all settings, so worker processes, logs and reports need only the spec.
"""

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from footfall.common.config import with_changes
from footfall.common.errors import UserError
from footfall.common.old_keys import current_key
from footfall.common.yaml_text import parse_yaml

_KEY = r"[A-Za-z_][\w.]*"
_SETTING = re.compile(rf"({_KEY})=(.*)", re.DOTALL)
_NEXT_SETTING = re.compile(rf"@(?={_KEY}=)")  # the @ before a setting; a file name may contain an @, too


class Change(NamedTuple):
    """Settings that replace others."""

    source: str  # text of the change in the spec
    key: tuple[str, ...]  # key of one setting; empty for a file
    content: Any  # value of the setting, or content of the file


def split_spec(spec: str) -> tuple[str, list[str]]:
    """Name of the controller, and the text of each change."""
    name, at, rest = spec.partition("@")
    return name, _NEXT_SETTING.split(rest) if at else []


def read_changes(name: str, parts: Sequence[str]) -> list[Change]:
    """Changes in a spec.

    Args:
        name: name of the controller. A file may have a section of this name, as `controllers.yaml` does.
        parts: parts from `split_spec`.

    Raises:
        UserError: a file cannot be read, or a value is not YAML.
    """
    return [_read(name, part) for part in parts]


def add_settings(specs: Sequence[str], settings: Sequence[str]) -> tuple[str, ...]:
    """Specs with settings from the option --set, CONTROLLER.KEY=VALUE each.

    Raises:
        UserError: a setting has another form, or its controller is not among the specs.
    """
    changed = list(specs)
    for setting in settings:
        name, dot, change = setting.partition(".")
        if not dot or not _SETTING.fullmatch(change):
            raise UserError(f"--set {setting}: expected CONTROLLER.KEY=VALUE, such as stand.kp=50")
        if all(split_spec(spec)[0] != name for spec in specs):
            raise UserError(f"--set {setting}: '{name}' is not among the policies {', '.join(specs)}")
        changed = [f"{spec}@{change}" if split_spec(spec)[0] == name else spec for spec in changed]
    return tuple(changed)


def short_name(name: str, parts: Sequence[str]) -> str:
    """A spec with file names instead of paths."""
    return "@".join([name, *(part if _SETTING.fullmatch(part) else Path(part).name for part in parts)])


def self_contained(name: str, parts: Sequence[str]) -> str:
    """A spec without files: their settings are written into it.

    Raises:
        UserError: as `read_changes`.
    """
    settings = [
        f"{'.'.join(key)}={_as_text(value)}"
        for change in read_changes(name, parts)
        for key, value in _leaves(change.key, change.content)
    ]
    return "@".join([name, *settings])


def _read(name: str, part: str) -> Change:
    if setting := _SETTING.fullmatch(part):
        try:
            value = parse_yaml(setting[2])
        except ValueError:
            raise UserError(f"{name}@{part}: '{setting[2]}' is not valid YAML") from None
        return Change(part, current_key(setting[1].split(".")), value)
    if not part:
        raise UserError(f"{name}@: expected a YAML file or KEY=VALUE after the @")
    if not Path(part).exists():
        raise UserError(
            f"{name}@{part}: there is no file {part}: give a YAML file or KEY=VALUE, such as kp=50"
        )
    content = with_changes({}, Path(part))
    return Change(part, (), content[name] if isinstance(content, dict) and name in content else content)


def _as_text(value: Any) -> str:
    return yaml.safe_dump(value, default_flow_style=True, width=math.inf).removesuffix("...\n").strip()


def _leaves(key: tuple[str, ...], content: Any) -> Iterator[tuple[tuple[str, ...], Any]]:
    if not isinstance(content, dict):
        yield key, content
        return
    for name, inner in content.items():
        yield from _leaves((*key, str(name)), inner)
