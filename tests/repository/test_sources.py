"""Robots are data: no code names a robot or a joint, except the default robot. Code files are small."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from footfall.robots.default import DEFAULT_ROBOT
from footfall.robots.description import available_robots, load_robot

ROOT = Path(__file__).parents[2]
ROOMS = ["src/footfall", *(room.name for room in (ROOT / "src/footfall").iterdir() if room.is_symlink())]
DEFAULT = ROOT / "robots" / "default.py"
NAMES = {name for robot in available_robots() for name in (robot, *load_robot(robot).joint_names)}
ANY_NAME = re.compile(rf"\b({'|'.join(map(re.escape, sorted(NAMES)))})\b")


def texts_of(path: Path) -> Iterator[tuple[int, str]]:
    """Strings and names of a Python file, with their lines; docstrings and comments may explain."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        match node:
            case ast.Constant(value=str(text)) if id(node) not in docstrings:
                yield node.lineno, text
            case ast.Name(id=text) | ast.Attribute(attr=text):
                yield node.lineno, text


@pytest.mark.parametrize("room", ROOMS)
def test_no_code_names_a_robot_that_ships_or_one_of_its_joints(room: str) -> None:
    files = [path for path in (ROOT / room).rglob("*.py") if path != DEFAULT]
    assert files
    found = [
        f"{path.relative_to(ROOT)}:{line}: {name}"
        for path in files
        for line, text in texts_of(path)
        for name in ANY_NAME.findall(text)
    ]
    assert found == []


def test_the_default_robot_ships() -> None:
    assert DEFAULT_ROBOT in available_robots()


def test_no_file_of_code_outside_the_tests_is_longer_than_300_lines() -> None:
    folders = [path for path in ROOT.iterdir() if path.is_dir() and path.name[0] != "."]
    others = {"tests", "build", "dist", "shared", "runs"}
    files = [path for folder in folders if folder.name not in others for path in folder.rglob("*.py")]
    assert files
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert {str(path.relative_to(ROOT)): count for path, count in lines.items() if count > 300} == {}
