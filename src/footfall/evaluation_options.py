"""What evaluate and compare share: their options, and the exit status after failed episodes."""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any

from cyclopts import Parameter

from footfall.evaluate.config import EvaluationConfig
from footfall.options import (
    AS_TYPED,
    ControllerSettings,
    Count,
    Index,
    JsonFile,
    Names,
    Plant,
    RobotName,
    ScenarioFile,
    Seed,
)
from footfall.robots.default import DEFAULT_ROBOT


@Parameter(name="*")
@dataclass(frozen=True)
class EvaluationOptions:
    """Options of `footfall evaluate` and `footfall compare`."""

    robot: RobotName = DEFAULT_ROBOT
    scenarios: Names = EvaluationConfig.scenarios
    """Names of scenarios, see evaluate/scenarios.yaml."""
    scenario_file: ScenarioFile = None
    episodes: Annotated[Count | None, Parameter(show_default=False)] = None
    """Episodes of each scenario (default: the scenario's own number)."""
    seed: Seed = 0
    plant: Plant = None
    ground_truth: bool = False
    """Hand policies the simulator's base velocity instead of an estimate, for study."""
    metrics: Annotated[Names, Parameter(show_default=False)] = ()
    """Metrics of your own, MODULE:NAME each: functions of a trace and a robot that return a number."""
    settings: ControllerSettings = ()
    workers: Annotated[Count | None, Parameter(show_default=False)] = None
    """Processes (default: one for each core)."""
    falls_allowed: Annotated[Index | None, AS_TYPED, Parameter(show_default=False)] = None
    """Most falls of a policy in all episodes; more are exit status 1 (default: falls are figures alone)."""
    json: JsonFile = None


NOMINAL = EvaluationOptions()  # every option left out
EPISODES_FAILED = 1  # or too many fell


def evaluation_config(options: EvaluationOptions) -> EvaluationConfig:
    """The options as `footfall.evaluate.api` takes them."""
    return EvaluationConfig(**{each.name: getattr(options, each.name) for each in fields(EvaluationConfig)})


def exit_status(results: Iterable[Mapping[str, Any]], falls_allowed: int | None = None) -> int:
    """0, or 1 and a line on stderr if an episode of a policy could not be run, or too many fell.

    Args:
        results: of policies, as `footfall.evaluate.api.evaluate_policy` returns them.
        falls_allowed: most falls of each policy; None for any number.
    """
    from footfall.evaluate.failures import failures

    scored = [list(result["scenarios"].values()) for result in results]
    lines = [failures([summary for summaries in scored for summary in summaries])]
    for summaries in scored if falls_allowed is not None else ():
        falls, episodes = (sum(summary[key] for summary in summaries) for key in ("falls", "episodes"))
        if falls > falls_allowed:
            lines.append(f"{falls} of {episodes} episodes fell, where --falls-allowed is {falls_allowed}")
    for line in filter(None, lines):
        print(f"footfall: {line}", file=sys.stderr)
    return EPISODES_FAILED if any(lines) else 0
