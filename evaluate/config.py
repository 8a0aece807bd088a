"""Settings of an evaluation: scenarios, episodes, seed, plant, processes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from footfall.common.engines import DEFAULT_ENGINE, EngineName
from footfall.robots.default import DEFAULT_ROBOT

if TYPE_CHECKING:
    from footfall.evaluate.missions import MakeMission

YAML = (".yaml", ".yml")  # of a mission's file


@dataclass(frozen=True)
class EvaluationConfig:
    """Settings that all policies of an evaluation share."""

    robot: str = DEFAULT_ROBOT  # name or folder
    scenarios: tuple[str, ...] = ("nominal", "push")  # names, see evaluate/scenarios.yaml
    seed: int = 0  # of all random draws
    episodes: int | None = None  # of each scenario; None: the scenario's own number
    plant: Path | None = None  # another MJCF than the robot's own
    ground_truth: bool = False  # give policies the true base velocity and height
    workers: int | None = None  # processes; None for one per core
    scenario_file: Path | None = None  # the user's scenarios, in addition to the shipped ones
    metrics: tuple[str, ...] = ()  # the user's metrics, MODULE:NAME each, see evaluate/own_metrics.py
    engine: EngineName = DEFAULT_ENGINE  # physics engine of the simulated robot
    get_up: str | None = None  # policy that gets the robot up after a fall; None: a fall ends the episode
    missions: Mapping[str, Path] = field(default_factory=dict)  # files of missions among the scenarios
    mission_run: "MakeMission | None" = None  # makes missions; scenarios with one need it


DEFAULT_EVALUATION = EvaluationConfig()


class ScenarioSelection(NamedTuple):
    """The scenarios and mission files in --scenarios."""

    scenarios: tuple[str, ...]  # names
    missions: dict[str, Path]  # files of the missions among the scenarios, by name


def parse_scenarios(given: Sequence[str]) -> ScenarioSelection:
    """Names of scenarios; a mission's file becomes a scenario with the file's name, without suffix."""
    missions = {each: Path(each) for each in given if Path(each).suffix.lower() in YAML}
    names = tuple(missions[each].stem if each in missions else each for each in given)
    return ScenarioSelection(names, {path.stem: path for path in missions.values()})
