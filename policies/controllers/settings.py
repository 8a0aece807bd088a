"""Settings of the hand-written controllers: one section each in a robot's `controllers.yaml`."""

from typing import Any, TypeVar

from footfall.common.config import read_yaml, structure
from footfall.common.errors import UserError
from footfall.robots.description import Robot

T = TypeVar("T")

SETTINGS_FILE = "controllers.yaml"


def configured_controllers(robot: Robot) -> dict[str, Any]:
    """The robot's settings file: one section for each controller by name; empty where there is no file.

    Raises:
        UserError: the file is no YAML, or no mapping.
    """
    path = robot.folder / SETTINGS_FILE
    if not path.is_file():
        return {}
    sections = read_yaml(path)
    if not isinstance(sections, dict):
        raise UserError(f"{path}: expected a section for each controller")
    return sections


def controller_settings(robot: Robot, controller: str, cls: type[T]) -> T:
    """One controller's section of the robot's settings.

    Raises:
        UserError: the robot has no such file or section, or a field is missing, unknown, of a wrong type or
            of a value that cannot work.
    """
    path = robot.folder / SETTINGS_FILE
    sections = configured_controllers(robot)
    if controller not in sections:
        raise UserError(
            f"robot '{robot.name}' has no settings for '{controller}': it has {', '.join(sections) or 'none'}"
            f" (a section '{controller}' in {path} would add it)"
        )
    return structure(sections[controller], cls, f"{path}: {controller}")
