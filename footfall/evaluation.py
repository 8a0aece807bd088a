"""Options that evaluate and compare share."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from footfall.options import Count, JsonFile, Names, Plant, RobotName, Seed


@Parameter(name="*")
@dataclass(frozen=True)
class EvaluationOptions:
    """What to put policies through."""

    robot: RobotName = "go1"
    scenarios: Names = ("nominal", "push")
    """Names in the scenario file."""
    episodes: Annotated[Count | None, Parameter(show_default=False)] = None
    """Episodes of each scenario (default: the scenario's own number)."""
    seed: Seed = 0
    plant: Plant = None
    ground_truth: bool = False
    """Hand policies the simulator's base velocity instead of an estimate, for study."""
    scenario_file: Path | None = None
    """Scenarios of your own, in the form of evaluate/scenarios.yaml."""
    workers: Annotated[Count | None, Parameter(show_default=False)] = None
    """Processes (default: one for each core)."""
    json: JsonFile = None


NOMINAL = EvaluationOptions()
