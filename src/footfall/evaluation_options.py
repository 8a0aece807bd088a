"""What evaluate and compare share: their options, and the exit status after failed episodes."""

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any

from cyclopts import Parameter

from footfall.evaluate.config import EvaluationConfig
from footfall.options import ControllerSettings, Count, JsonFile, Names, Plant, RobotName, ScenarioFile, Seed
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
    json: JsonFile = None


NOMINAL = EvaluationOptions()  # every option left out
EPISODES_FAILED = 1


def evaluation_config(options: EvaluationOptions) -> EvaluationConfig:
    """The options as `footfall.evaluate.api` takes them."""
    return EvaluationConfig(**{each.name: getattr(options, each.name) for each in fields(EvaluationConfig)})


def exit_status(results: Iterable[Mapping[str, Any]]) -> int:
    """0, or 1 and one line on stderr if an episode of a policy failed.

    Args:
        results: of policies, as `footfall.evaluate.api.evaluate_policy` returns them.
    """
    from footfall.evaluate.failures import failures

    line = failures([summary for result in results for summary in result["scenarios"].values()])
    if line:
        print(f"footfall: {line}", file=sys.stderr)
    return EPISODES_FAILED if line else 0
