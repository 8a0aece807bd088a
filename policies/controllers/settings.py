"""Settings of the hand-written controllers: one section for each in a robot's `controllers.yaml`."""

from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, get_args, get_type_hints

from footfall.common.config import merged, read_yaml, structure
from footfall.common.errors import UserError
from footfall.common.hints import no_setting
from footfall.policies.spec import Change
from footfall.robots.description import Robot

T = TypeVar("T")
Key = tuple[str, ...]

SETTINGS_FILE = "controllers.yaml"


def configured_controllers(robot: Robot) -> dict[str, Any]:
    """The robot's settings file: one section for each controller by name; empty if there is no file.

    Raises:
        UserError: the file is not YAML, or not a mapping.
    """
    path = robot.folder / SETTINGS_FILE
    if not path.is_file():
        return {}
    sections = read_yaml(path)
    if not isinstance(sections, dict):
        raise UserError(f"{path}: expected a section for each controller")
    return sections


def controller_settings(robot: Robot, controller: str, cls: type[T], changes: Sequence[Change] = ()) -> T:
    """One controller's section of the robot's settings.

    Args:
        robot: robot with the settings.
        controller: name of the controller.
        cls: dataclass of its settings.
        changes: changes to the robot's settings.

    Raises:
        UserError: the robot has no such file or section, or a field is missing, unknown, of a wrong type or
            out of range.
    """
    path = robot.folder / SETTINGS_FILE
    sections = configured_controllers(robot)
    if controller not in sections:
        raise UserError(
            f"robot '{robot.name}' has no settings for '{controller}': it has {', '.join(sections) or 'none'}"
            f" (a section '{controller}' in {path} would add it)"
        )
    section = sections[controller]
    settings = structure(section, cls, f"{path}: {controller}")
    if not changes:
        return settings
    for change in changes:
        key = _full_key(change.key, cls, f"{controller}@{change.source}")
        section = merged(section, _nested(key, change.content))
    return structure(section, cls, "@".join([controller, *(change.source for change in changes)]))


def _nested(key: Key, content: Any) -> Any:
    """Content nested under a key."""
    for name in reversed(key):
        content = {name: content}
    return content


def _full_key(key: Key, cls: type, source: str) -> Key:
    """Full key of a setting: the first parts may be omitted if only one setting has the remaining ones.

    Raises:
        UserError: no setting, or several settings, match.
    """
    keys = list(_keys(cls))
    matches = [each for each in keys if each[-len(key) :] == key]
    if any(each[: len(key)] == key for each in keys):  # a full key, or a group of settings
        return key
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise UserError(
            f"{source}: ambiguous, could be {' or '.join(map('.'.join, matches))}: give the full key"
        )
    raise UserError(f"{source}: {no_setting(['.'.join(key)], ['.'.join(each) for each in keys])}")


def _keys(cls: type) -> Iterator[Key]:
    """Keys of all settings, including those of nested dataclasses."""
    kinds = get_type_hints(cls)
    for field in fields(cls):
        kind = next((part for part in get_args(kinds[field.name]) if is_dataclass(part)), kinds[field.name])
        if isinstance(kind, type) and is_dataclass(kind):
            yield from ((field.name, *inner) for inner in _keys(kind))
        else:
            yield (field.name,)
