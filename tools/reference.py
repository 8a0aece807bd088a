"""Generated sections of the reference pages: each is a function that returns Markdown.

The content comes from the code: fields of dataclasses with their comments, the parser, docstrings of terms.
"""

import ast
import inspect
import io
import json
import math
import textwrap
import tokenize
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import yaml
from fault_reference import faults

from footfall.cli import app
from footfall.deploy.config import DeployConfig
from footfall.deploy.telemetry.topics import TOPICS
from footfall.evaluate.scenarios import Scenario
from footfall.operate.gamepad import GamepadConfig
from footfall.operate.keyboard import KeyboardConfig
from footfall.operate.missions.mission import MissionSettings
from footfall.operate.missions.steps import STEPS
from footfall.operate.ros2 import table
from footfall.operate.udp import UdpConfig
from footfall.plant.episode import Episode
from footfall.plant.trace import Trace
from footfall.policies.contract import Contract
from footfall.policies.policy import PolicyInput
from footfall.robots.description import Robot
from footfall.robots.robot_yaml import Description
from footfall.train.config import TrainConfig

ROOT = Path(__file__).parents[1]
MEASUREMENTS = ROOT / "docs" / "measurements.yaml"


def command_line() -> str:
    """Every verb with its options, from the parser's own help."""
    text = app.generate_docs(recursive=True, heading_level=1)
    return text[text.index("## footfall train") :]


def settings(cls: type, path: str = "", seen: dict[type, str] | None = None) -> str:
    """A table of a dataclass's fields, and one for each dataclass that they hold, as Markdown.

    Args:
        cls: the dataclass that a YAML file is read into.
        path: dotted key of the section; empty for the whole file.
        seen: key of the table that each dataclass has already.
    """
    seen = {} if seen is None else seen
    parts = [f"## `{path}`\n" if path else "## Top level\n", _first_paragraph(cls), ""]
    parts += ["| key | type | default | meaning |", "| --- | --- | --- | --- |"]
    hints, comments = get_type_hints(cls), _comments(cls)
    inner: list[str] = []
    for each in fields(cls):
        key = f"{path}.{each.name}" if path else each.name
        nested, suffix = _nested(hints[each.name])
        kind = _type(hints[each.name])
        if nested is not None:
            if nested not in seen:
                seen[nested] = key + suffix
                inner.append(settings(nested, key + suffix, seen))
            kind = f"[{kind}](#{_anchor(seen[nested])})"
        meaning = _cell(comments.get(each.name, ""))
        parts.append(f"| `{each.name}` | {kind} | {_default(each)} | {meaning} |")
    return "\n".join([*parts, "", *inner])


def attributes(cls: type) -> str:
    """A table of a class's attributes and the comments beside them, as Markdown."""
    rows = [f"| `{name}` | {_cell(meaning)} |" for name, meaning in _comments(cls).items()]
    return "\n".join(["| attribute | meaning |", "| --- | --- |", *rows])


def _nested(hint: Any) -> tuple[type | None, str]:
    """The dataclass in a field's type, directly or in a container, and the suffix of its key."""
    if isinstance(hint, type) and is_dataclass(hint):
        return hint, ""
    suffix = {tuple: "[]", list: "[]", dict: ".NAME"}.get(get_origin(hint), "")
    for argument in get_args(hint):
        nested, inner_suffix = _nested(argument)
        if nested is not None:
            return nested, suffix + inner_suffix
    return None, ""


def _type(hint: Any) -> str:
    names = {int: "whole number", float: "number", str: "text", bool: "true or false", type(None): "nothing"}
    if hint in names:
        return names[hint]
    origin, arguments = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return " or ".join(_type(argument) for argument in arguments if argument is not type(None))
    if origin is tuple and Ellipsis in arguments:
        return f"list of {_type(arguments[0])}"
    if origin is tuple:
        return f"{len(arguments)} × {_type(arguments[0])}"
    if origin is dict:
        return f"mapping to {_type(arguments[1])}"
    if arguments:  # Literal
        return ", ".join(f"`{argument}`" for argument in arguments)
    return "section" if is_dataclass(hint) else "any"


def _default(each: "Field[Any]") -> str:
    if each.default is not MISSING:
        value = each.default
    elif each.default_factory is not MISSING:
        value = each.default_factory()
    else:
        return "required"
    if is_dataclass(value) or value in ({}, ()):
        return ""
    return "none" if value is None else f"`{json.dumps(value, default=str)}`"


@cache
def _comments(cls: type) -> dict[str, str]:
    """The comments beside and above each field of a dataclass, by field; base classes included."""
    comments: dict[str, str] = {}
    for base in reversed([base for base in cls.__mro__ if base.__module__.startswith("footfall.")]):
        source = textwrap.dedent(inspect.getsource(base))
        [tree] = ast.parse(source).body
        assert isinstance(tree, ast.ClassDef)
        by_line = {
            token.start[0]: (token.string.lstrip("# "), token.line.lstrip().startswith("#"))
            for token in tokenize.generate_tokens(io.StringIO(source).readline)
            if token.type == tokenize.COMMENT
        }
        for node in tree.body:
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                beside = [line for line in range(node.lineno, (node.end_lineno or 0) + 1) if line in by_line]
                lines = beside or [*_lines_above(node.lineno, by_line)]
                comments[node.target.id] = " ".join(by_line[line][0] for line in lines)
    return comments


def _lines_above(lineno: int, by_line: dict[int, tuple[str, bool]]) -> range:
    """The numbers of the comment lines directly above a field."""
    first = lineno
    while by_line.get(first - 1, ("", False))[1]:
        first -= 1
    return range(first, lineno)


def _first_paragraph(thing: Any) -> str:
    return (inspect.getdoc(thing) or "").partition("\n\n")[0].replace("\n", " ")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _anchor(key: str) -> str:
    """The anchor that the site gives the heading `key`."""
    return "".join(c for c in key.lower() if c.isalnum() or c in "_-")


def terms() -> str:
    """Every term, kind by kind: its parameters with their defaults and limits, and what it computes."""
    from footfall.envs.catalogue import catalogue, default_and_limits

    parts, kind = [], ""
    for term in catalogue():
        if term.kind != kind:
            kind = term.kind
            parts += [
                f"\n## {kind.capitalize()}\n",
                "| term | parameters | computes |",
                "| --- | --- | --- |",
            ]
        parameters = "; ".join(
            f"`{name}`: {default_and_limits(each)}" for name, each in term.parameters.items()
        )
        parts.append(f"| `{term.name}` | {_cell(parameters)} | {_cell(term.about)} |")
    return "\n".join(parts)


def missions() -> str:
    """The settings of a mission, and the keys of each kind of step."""
    steps = [settings(cls).replace("## Top level", f"## `{kind}`", 1) for kind, cls in STEPS.items()]
    return "\n".join([settings(MissionSettings), *steps])


def operators() -> str:
    """The settings of keyboard, gamepad and UDP."""
    kinds = {"keyboard": KeyboardConfig, "gamepad": GamepadConfig, "udp": UdpConfig}
    parts = [settings(cls).replace("## Top level", f"## {kind}", 1) for kind, cls in kinds.items()]
    return "\n".join(part.replace("## ", "### ") for part in parts)


def measurements() -> str:
    """Every table of `docs/measurements.yaml` with its condition, command and machine."""
    tables = yaml.safe_load(MEASUREMENTS.read_text(encoding="utf-8"))
    return "\n\n".join(_measurement(table) for table in tables)


def _measurement(table: dict[str, Any]) -> str:
    facts = [
        *([f"**Command** `{table['command']}`"] if "command" in table else []),
        *([f"**Machine** {table['machine']}"] if "machine" in table else []),
        *([f"**Source** `{table['recorded']}`"] if "recorded" in table else []),
    ]
    rows = [table["columns"], ["---"] * len(table["columns"]), *table["rows"]]
    lines = ["| " + " | ".join(str(cell) or " " for cell in row) + " |" for row in rows]
    return "\n".join(
        [f"## {table['title']}", "", table.get("condition", ""), "", *lines, "", ". ".join(facts)]
    )


def ros2() -> str:
    """The ROS 2 topics, services and action of a run."""
    published = [
        (table.absolute(each.name), TOPICS[each.feed].kind, _at_most(each.rate_hz), each.about)
        for each in table.PUBLISHED
    ]
    topics = [(table.absolute(each.name), each.kind, each.about) for each in table.SUBSCRIBED]
    offered = (*table.SERVICES, *table.CHOICES.values(), table.WAVE, table.FOLLOW_PATH)
    services = [(table.absolute(each.name), each.kind, each.about) for each in offered]
    return "\n\n".join(
        [
            _table(("published", "type", "at most, Hz", "content"), published),
            _table(("subscribed", "type", "content"), topics),
            _table(("service or action (rclpy)", "type", "what it does"), services),
        ]
    )


def _at_most(rate_hz: float) -> str:
    return f"{rate_hz:g}" if math.isfinite(rate_hz) else ""


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table whose first two columns are code."""
    lines = [f"| `{first}` | `{second}` | {' | '.join(rest)} |" for first, second, *rest in rows]
    return "\n".join([f"| {' | '.join(head)} |", "| --- " * len(head) + "|", *lines])


SECTIONS: dict[str, Callable[[], str]] = {
    "command-line": command_line,
    "presets": lambda: settings(TrainConfig),
    "robot-yaml": lambda: settings(Description),
    "deploy-yaml": lambda: settings(DeployConfig),
    "scenarios-yaml": lambda: settings(Scenario),
    "mission-yaml": missions,
    "steering-yaml": operators,
    "contract": lambda: settings(Contract),
    "episode": lambda: attributes(Episode),
    "trace": lambda: attributes(Trace),
    "policy-input": lambda: attributes(PolicyInput),
    "robot": lambda: attributes(Robot),
    "terms": terms,
    "measurements": measurements,
    "faults": faults,
    "ros2": ros2,
}
