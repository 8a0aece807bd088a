"""Robots are data: no code knows one, or a joint of one, by name, but for the one that is the default."""

import re
from pathlib import Path

import pytest

from footfall.robots.default import DEFAULT_ROBOT
from footfall.robots.description import available_robots, load_robot

ROOT = Path(__file__).parents[1]
ROOMS = ["footfall", *(room.name for room in (ROOT / "footfall").iterdir() if room.is_symlink())]
DEFAULT = ROOT / "robots" / "default.py"
CODE = {".py", ".html", ".js"}  # a robot's settings are YAML, and the zoo's cards Markdown
NAMES = {name for robot in available_robots() for name in (robot, *load_robot(robot).joint_names)}
ANY_NAME = re.compile(rf"\b({'|'.join(map(re.escape, sorted(NAMES)))})\b")


@pytest.mark.parametrize("room", ROOMS)
def test_no_code_names_a_robot_that_ships_or_one_of_its_joints(room: str) -> None:
    files = [path for path in (ROOT / room).rglob("*") if path.suffix in CODE and path != DEFAULT]
    assert files
    found = [
        f"{path.relative_to(ROOT)}:{number}: {name}"
        for path in files
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        for name in ANY_NAME.findall(line)
    ]
    assert found == []


def test_the_robot_that_is_meant_where_none_is_named_ships() -> None:
    assert DEFAULT_ROBOT in available_robots()
