"""Settings of the hand-written controllers: one section each in a robot's `controllers.yaml`."""

from typing import TypeVar

from footfall.common.config import read_yaml, structure
from footfall.common.errors import UserError
from footfall.robots.description import Robot

T = TypeVar("T")

SETTINGS_FILE = "controllers.yaml"


def controller_settings(robot: Robot, controller: str, cls: type[T]) -> T:
    """One controller's section of the robot's settings.

    Raises:
        UserError: the robot has no such file or section, or a field is missing, unknown or of a wrong type.
    """
    path = robot.folder / SETTINGS_FILE
    if not path.is_file():
        raise UserError(f"robot '{robot.name}' has no settings for '{controller}': write {path}")
    sections = read_yaml(path)
    if not isinstance(sections, dict) or controller not in sections:
        raise UserError(f"{path}: no section '{controller}'")
    return structure(sections[controller], cls, f"{path}: {controller}")
