"""Options of evaluate and compare, and their report of failures."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from footfall.common.engines import DEFAULT_ENGINE
from footfall.common.errors import UserError
from footfall.evaluate.config import EvaluationConfig, parse_scenarios
from footfall.options import (
    AS_TYPED,
    ControllerSettings,
    Count,
    Engine,
    JsonFile,
    Names,
    OptionalPath,
    Plant,
    RobotName,
    ScenarioFile,
    Seed,
)
from footfall.robots.default import DEFAULT_ROBOT

if TYPE_CHECKING:
    from footfall.evaluate.requirements import Requirement, Results


@Parameter(name="*")
@dataclass(frozen=True)
class EvaluationOptions:
    """Options of `footfall evaluate` and `footfall compare`."""

    robot: RobotName = DEFAULT_ROBOT
    scenarios: Names = EvaluationConfig.scenarios
    """Names of scenarios (see evaluate/scenarios.yaml), or YAML files of missions."""
    scenario_file: ScenarioFile = None
    episodes: Annotated[Count | None, Parameter(show_default=False)] = None
    """Episodes of each scenario (default: the scenario's own number)."""
    seed: Seed = 0
    plant: Plant = None
    engine: Engine = DEFAULT_ENGINE
    ground_truth: bool = False
    """Give policies the simulator's base velocity instead of an estimate, for studies."""
    get_up: Annotated[str | None, AS_TYPED, Parameter(show_default=False)] = None
    """Get up after a fall with this policy and walk on (default: a fall ends the episode)."""
    metrics: Annotated[Names, Parameter(show_default=False)] = ()
    """Metrics of your own, MODULE:NAME each: functions of a trace and a robot that return a number."""
    settings: ControllerSettings = ()
    workers: Annotated[Count | None, Parameter(show_default=False)] = None
    """Number of processes (default: number of cores)."""
    require: Annotated[tuple[str, ...], Parameter(negative=(), show_default=False, metavar="TEXT")] = ()
    """Limit of a figure, such as 'nominal.falls <= 0'; exit 1 if violated; may be repeated."""
    junit: Annotated[OptionalPath, Parameter(show_default=False)] = None
    """Write the requirements' outcomes to this file, as JUnit XML."""
    json: JsonFile = None


DEFAULT_OPTIONS = EvaluationOptions()
FAILED = 1  # exit status: an episode failed, or a requirement is not met


def evaluation_config(options: EvaluationOptions) -> EvaluationConfig:
    """The options as a configuration for `footfall.evaluate.api`."""
    from footfall.operate.missions.run import mission_run

    parsed = {**parse_scenarios(options.scenarios)._asdict(), "mission_run": mission_run}
    names = [each.name for each in fields(EvaluationConfig) if each.name not in parsed]
    return EvaluationConfig(**{name: getattr(options, name) for name in names}, **parsed)


def requirements_of(options: EvaluationOptions) -> "list[Requirement]":
    """The requirements, checked before any episode.

    Raises:
        UserError: a requirement is malformed or has an unknown name, or the XML file cannot be written.
    """
    from footfall.common.outputs import check_outputs
    from footfall.evaluate.requirements import parse_requirements

    if options.junit is not None and not options.require:
        raise UserError("--junit needs a requirement: add --require 'nominal.falls <= 0'")
    check_outputs(options.junit)
    return parse_requirements(options.require, parse_scenarios(options.scenarios).scenarios, options.metrics)


def report_failures(
    results: "Results", requirements: "Sequence[Requirement]" = (), junit: Path | None = None
) -> int:
    """Print failures on stderr, and write the JUnit file.

    Returns:
        The exit status: 0, or `FAILED` if an episode failed or a requirement is not met.

    Args:
        results: results by policy, as from `footfall.evaluate.api.evaluate_policy`.
        requirements: requirements from `requirements_of`.
        junit: JUnit file for their outcomes.
    """
    from footfall.common.outputs import write_text
    from footfall.evaluate.failures import failures
    from footfall.evaluate.requirements import junit_xml, outcomes_of

    summaries = [summary for result in results.values() for summary in result["scenarios"].values()]
    outcomes = outcomes_of(requirements, results)
    if junit is not None:
        write_text(junit, junit_xml(outcomes))
    lines = [failures(summaries), *(outcome.line for outcome in outcomes if not outcome.met)]
    for line in filter(None, lines):
        print(f"footfall: {line}", file=sys.stderr)
    return FAILED if any(lines) else 0
