"""`footfall list`."""

import json as json_text
from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import Parameter

Rows = list[dict[str, Any]]


def list_names(*, json: Annotated[bool, Parameter(negative=())] = False) -> None:
    """Show what there is to name: robots, controllers, policies of the zoo, scenarios, presets.

    Parameters
    ----------
    json
        Print JSON instead of tables.
    """
    robots = _robots()
    found = {
        "robots": robots,
        "controllers": _controllers(robots),
        "policies": _policies(),
        "scenarios": _scenarios(),
        "presets": _presets(),
    }
    if json:
        print(json_text.dumps(found, indent=2))
    else:
        _show(found)


def _robots() -> Rows:
    from footfall.policies.registry import controllers_of, zoo_names
    from footfall.robots.description import available_robots, load_robot

    return [
        {
            "name": robot.name,
            "feet": len(robot.description.feet),
            "joints": len(robot.joint_names),
            "controllers": controllers_of(robot),
            "policies": zoo_names(robot),
        }
        for robot in map(load_robot, available_robots())
    ]


def _controllers(robots: Rows) -> Rows:
    from footfall.policies.registry import CONTROLLERS

    return [
        {
            "name": name,
            "about": controller.about,
            "walks": controller.walks,
            "robots": [robot["name"] for robot in robots if name in robot["controllers"]],
        }
        for name, controller in CONTROLLERS.items()
    ]


def _policies() -> Rows:
    from footfall.common.config import read_yaml
    from footfall.policies.registry import ZOO, zoo_names

    runs = {name: read_yaml(ZOO / name / "run.yaml") for name in zoo_names()}
    return [
        {"name": name, **{key: run[key] for key in ("robot", "preset", "trainer", "created")}}
        for name, run in runs.items()
    ]


def _scenarios() -> Rows:
    from footfall.evaluate.scenarios import described

    return [
        {"name": name, "about": told.about, "episodes": told.episodes, "duration_s": told.duration_s}
        for name, told in described().items()
    ]


def _presets() -> Rows:
    from footfall.train.config import PRESETS, available_presets, load_preset

    return [
        {
            "name": name,
            "about": (PRESETS / f"{name}.yaml").read_text().partition("\n")[0].removeprefix("# "),
            "total_steps": load_preset(name).ppo.total_steps,
        }
        for name in available_presets()
    ]


def _show(found: dict[str, Rows]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    for kind, rows in found.items():
        table = Table(title=kind, title_justify="left", title_style="bold", box=None)
        for field in rows[0]:
            table.add_column(field.replace("_", " "), no_wrap=field == "name")
        for row in rows:
            table.add_row(*(Text(_cell(value)) for value in row.values()))
        console.print(table)
        console.print()


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int | float):
        return f"{value:,}" if isinstance(value, int) else f"{value:g}"
    return ", ".join(value) if isinstance(value, Sequence) and not isinstance(value, str) else str(value)
