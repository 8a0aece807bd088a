"""What an evaluation runs: scenarios, episodes, seed, plant, processes."""

from dataclasses import dataclass
from pathlib import Path

from footfall.common.engines import DEFAULT_ENGINE, EngineName
from footfall.robots.default import DEFAULT_ROBOT


@dataclass(frozen=True)
class EvaluationConfig:
    """What all policies of an evaluation share."""

    robot: str = DEFAULT_ROBOT  # name or folder
    scenarios: tuple[str, ...] = ("nominal", "push")  # names, see evaluate/scenarios.yaml
    seed: int = 0  # of everything that is drawn
    episodes: int | None = None  # of each scenario; None for the scenario's own number
    plant: Path | None = None  # another MJCF than the robot's own
    ground_truth: bool = False  # hand policies the true base velocity and height
    workers: int | None = None  # processes; None for one per core
    scenario_file: Path | None = None  # the user's scenarios, beside those of footfall
    metrics: tuple[str, ...] = ()  # the user's, MODULE:NAME each, see evaluate/own_metrics.py
    engine: EngineName = DEFAULT_ENGINE  # what moves the simulated robot's bodies
    get_up: str | None = None  # policy that gets the robot up after a fall; None: a fall ends the episode


DEFAULT_EVALUATION = EvaluationConfig()
