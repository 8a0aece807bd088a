"""Spec of a hand-written controller as a user types it: its name, and changes of its settings.

    trot                             with the robot's own settings
    trot@mine.yaml                   with those of a file in their place, as far as it has any
    trot@gait.period_s=0.5@kp=90     with some of them replaced
    trot@mine.yaml@gait.period_s=0.5 with both

So a contender's settings go wherever its name goes: to worker processes, into a log, into a report.
"""

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from footfall.common.config import with_changes
from footfall.common.errors import UserError
from footfall.common.yaml_text import parse_yaml

_KEY = r"[A-Za-z_][\w.]*"
_SETTING = re.compile(rf"({_KEY})=(.*)", re.DOTALL)
_NEXT = re.compile(rf"@(?={_KEY}=)")  # a file's name may hold an @ too


class Change(NamedTuple):
    """Settings that replace others."""

    source: str  # as it was typed
    key: tuple[str, ...]  # of one setting; none for a file
    content: Any  # that setting's value, or what the file holds


def split_spec(spec: str) -> tuple[str, list[str]]:
    """The name, and as typed each file and setting that follows it."""
    name, at, rest = spec.partition("@")
    return name, _NEXT.split(rest) if at else []


def read_changes(name: str, parts: Sequence[str]) -> list[Change]:
    """What a spec changes.

    Args:
        name: of the controller. A file may hold its section under this name, as `controllers.yaml` does.
        parts: from `split_spec`.

    Raises:
        UserError: a file cannot be read, or a value is no YAML.
    """
    return [_read(name, part) for part in parts]


def add_settings(specs: Sequence[str], settings: Sequence[str]) -> tuple[str, ...]:
    """Specs with the settings of a command line's --set, CONTROLLER.KEY=VALUE each.

    Raises:
        UserError: a setting is of another form, or of a controller that is not among the specs.
    """
    given = list(specs)
    for setting in settings:
        name, dot, change = setting.partition(".")
        if not dot or not _SETTING.fullmatch(change):
            raise UserError(f"--set {setting}: expected CONTROLLER.KEY=VALUE, such as stand.kp=50")
        if all(split_spec(spec)[0] != name for spec in specs):
            raise UserError(f"--set {setting}: '{name}' is not among the policies {', '.join(specs)}")
        given = [f"{spec}@{change}" if split_spec(spec)[0] == name else spec for spec in given]
    return tuple(given)


def short_name(name: str, parts: Sequence[str]) -> str:
    """A spec without its files' folders."""
    return "@".join([name, *(part if _SETTING.fullmatch(part) else Path(part).name for part in parts)])


def self_contained(name: str, parts: Sequence[str]) -> str:
    """A spec that needs no file: those of its settings that files hold are written out.

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
        return Change(part, tuple(setting[1].split(".")), value)
    if not part:
        raise UserError(f"{name}@: expected a YAML file or KEY=VALUE after the @")
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
