"""`footfall list`."""

import json as json_text
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from footfall.common.installation import needs_extra
from footfall.options import AS_TYPED, RobotName

if TYPE_CHECKING:
    from footfall.robots.description import Robot

Rows = list[dict[str, Any]]


Kind = Literal["robots", "controllers", "policies", "scenarios", "presets", "terms"]


def list_names(
    kind: Kind | None = None,
    /,
    *,
    robot: Annotated[RobotName | None, AS_TYPED] = None,
    json: Annotated[bool, Parameter(negative=())] = False,
) -> None:
    """Show the names of robots, controllers, zoo policies, scenarios and presets, or of terms.

    Parameters
    ----------
    kind
        Show only this kind. `terms` are the components of a preset's task (extra: train).
    robot
        Show only this robot, its controllers and its policies: a name, or a folder with its robot.yaml.
    json
        Print JSON instead of tables.
    """
    from footfall.robots.description import available_robots, load_robot

    robots = [load_robot(name) for name in ([robot] if robot else available_robots())]
    kinds: dict[str, Callable[[], Rows]] = {
        "robots": partial(_robots, robots),
        "controllers": partial(_controllers, robots),
        "policies": partial(_policies, robots),
        "scenarios": _scenarios,
        "presets": _presets,
        "terms": _terms,
    }
    kinds_shown = [kind] if kind else [name for name in kinds if name != "terms"]
    rows_by_kind = {name: kinds[name]() for name in kinds_shown}
    if json:
        print(json_text.dumps(rows_by_kind, indent=2))
    else:
        _show(rows_by_kind)


def _robots(robots: "list[Robot]") -> Rows:
    from footfall.policies.registry import controllers_of, zoo_names

    return [
        {
            "name": robot.name,
            "feet": len(robot.description.feet),
            "joints": len(robot.joint_names),
            "controllers": controllers_of(robot),
            "policies": zoo_names(robot),
        }
        for robot in robots
    ]


def _controllers(robots: "list[Robot]") -> Rows:
    from footfall.policies.registry import CONTROLLERS, controllers_of

    controllers_by_robot = {robot.name: controllers_of(robot) for robot in robots}
    return [
        {
            "name": name,
            "about": controller.about,
            "walks": controller.walks,
            "robots": [robot for robot, controllers in controllers_by_robot.items() if name in controllers],
        }
        for name, controller in CONTROLLERS.items()
        if any(name in controllers for controllers in controllers_by_robot.values())
    ]


def _policies(robots: "list[Robot]") -> Rows:
    from footfall.common.config import read_yaml
    from footfall.policies.registry import ZOO, zoo_names

    runs = {name: read_yaml(ZOO / name / "run.yaml") for robot in robots for name in zoo_names(robot)}
    return [
        {"name": name, **{key: run[key] for key in ("robot", "preset", "trainer", "created")}}
        for name, run in runs.items()
    ]


def _scenarios() -> Rows:
    from footfall.evaluate.scenarios import shipped_scenarios

    return [
        {"name": name, "about": each.about, "episodes": each.episodes, "duration_s": each.duration_s}
        for name, each in shipped_scenarios().items()
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
    with needs_extra("train", "the list of terms needs"):
        from footfall.envs.catalogue import catalogue, default_and_limits

    return [
        {
            "kind": term.kind,
            "name": term.name,
            "parameters": ", ".join(
                f"{name}: {default_and_limits(each)}" for name, each in term.parameters.items()
            ),
            "about": term.about,
        }
        for term in catalogue()
    ]


def _show(rows_by_kind: dict[str, Rows]) -> None:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console()
    for kind, rows in rows_by_kind.items():
        if not rows:
            console.print(f"{kind}: none", style="bold", end="\n\n")
            continue
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
