"""Settings of a sweep, as written in its YAML file, and of its trials."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from footfall.robots.default import DEFAULT_ROBOT
from footfall.robots.description import Robot
from footfall.train.config import TrainConfig, load_preset, with_settings
from footfall.train.trainers import DEFAULT_TRAINER


@dataclass(frozen=True)
class SweepConfig:
    """What to sweep, as written in a sweep's YAML file."""

    space: dict[str, dict[str, list[Any]]]  # ppo.learning_rate: {loguniform: [1.0e-4, 1.0e-2]}
    robot: str = DEFAULT_ROBOT
    preset: str = "cpu"
    trainer: str = DEFAULT_TRAINER
    seeds: tuple[int, ...] = (0,)  # every point of the space is trained with each
    trials: int = 1  # draws from the space; lists under grid_search multiply them
    metric: str = "tracking/linear_error_m_s"
    mode: Literal["min", "max"] = "min"
    concurrent: int | None = None  # trials at once; None: as many as fit the machine
    cpus: float = 1.0  # for each trial
    gpus: float = 0.0  # for each trial; trials may share one
    # Name and settings as ray.tune.create_scheduler takes them.
    scheduler: dict[str, Any] = field(default_factory=lambda: {"name": "fifo"})

    def __post_init__(self) -> None:
        if not self.seeds:
            raise ValueError("seeds: the list is empty")
        if self.trials < 1:
            raise ValueError(f"trials must be at least 1, not {self.trials}")

    @property
    def trainings(self) -> int:
        """Number of trainings in the whole sweep."""
        grids = [
            len(declared["grid_search"]) for declared in self.space.values() if "grid_search" in declared
        ]
        return math.prod(grids) * len(self.seeds) * self.trials


def trial_config(preset: str, settings: dict[str, Any], robot: Robot) -> TrainConfig:
    """A robot's preset with some settings replaced, named by dotted keys.

    Raises:
        UserError: there is no such setting, or a value does not fit it.
    """
    return with_settings(load_preset(preset, robot), settings, f"preset {preset}")
