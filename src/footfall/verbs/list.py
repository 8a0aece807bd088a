"""`footfall list`."""

import json as json_text
from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from footfall.common.installation import needs_extra

Rows = list[dict[str, Any]]


Kind = Literal["robots", "controllers", "policies", "scenarios", "presets", "terms"]


def list_names(kind: Kind | None = None, /, *, json: Annotated[bool, Parameter(negative=())] = False) -> None:
    """Show the names of robots, controllers, policies of the zoo, scenarios and presets, or of terms.

    Parameters
    ----------
    kind
        Show this kind alone. `terms` are what a preset's task is made of (an extra: train).
    json
        Print JSON instead of tables.
    """
    kinds: dict[str, Callable[[], Rows]] = {
        "robots": _robots,
        "controllers": _controllers,
        "policies": _policies,
        "scenarios": _scenarios,
        "presets": _presets,
        "terms": _terms,
    }
    shown = [kind] if kind else [name for name in kinds if name != "terms"]
    found = {name: kinds[name]() for name in shown}
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


def _controllers() -> Rows:
    from footfall.policies.registry import CONTROLLERS, controllers_of
    from footfall.robots.description import available_robots, load_robot

    robots = {robot.name: controllers_of(robot) for robot in map(load_robot, available_robots())}
    return [
        {
            "name": name,
            "about": controller.about,
            "walks": controller.walks,
            "robots": [robot for robot, controllers in robots.items() if name in controllers],
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


def _terms() -> Rows:
    with needs_extra("train", "the terms of tasks need"):
        from footfall.envs.catalogue import catalogue, shown

    return [
        {
            "kind": term.kind,
            "name": term.name,
            "parameters": ", ".join(f"{name}: {shown(each)}" for name, each in term.parameters.items()),
            "about": term.about,
        }
        for term in catalogue()
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
