"""Settings of a sweep, as they stand in its YAML file, and of its trials."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal

from footfall.common.config import by_label, merged, unstructure
from footfall.common.errors import UserError
from footfall.robots.default import DEFAULT_ROBOT
from footfall.robots.description import Robot
from footfall.train.config import TrainConfig, load_preset, train_config
from footfall.train.old_names import with_current_names
from footfall.train.trainers import DEFAULT_TRAINER


@dataclass(frozen=True)
class SweepConfig:
    """What to sweep, as it stands in a sweep's YAML file."""

    space: dict[str, dict[str, list[Any]]]  # ppo.learning_rate: {loguniform: [1.0e-4, 1.0e-2]}
    robot: str = DEFAULT_ROBOT
    preset: str = "cpu"
    trainer: str = DEFAULT_TRAINER
    seeds: tuple[int, ...] = (0,)  # every point of the space is trained with each
    trials: int = 1  # draws from the space; lists under grid_search multiply them
    metric: str = "tracking/linear_error_m_s"
    mode: Literal["min", "max"] = "min"
    concurrent: int | None = None  # trials at once; as many as fit the machine by default
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
    def points(self) -> int:
        """Trainings in the whole sweep."""
        grids = [
            len(declared["grid_search"]) for declared in self.space.values() if "grid_search" in declared
        ]
        return math.prod(grids) * len(self.seeds) * self.trials


def trial_config(preset: str, settings: dict[str, Any], robot: Robot) -> TrainConfig:
    """A robot's preset with some settings replaced, named by dotted keys.

    Raises:
        UserError: there is no such setting, or a value does not fit it.
    """
    data = unstructure(load_preset(preset, robot))
    changes: dict[str, Any] = {}
    for key, value in settings.items():
        *parents, name = key.split(".")
        there, changed = data, changes
        for parent in parents:
            there = by_label(there.get(parent)) if isinstance(there, dict) else None
            changed = changed.setdefault(parent, {})
        if not isinstance(there, dict):
            raise UserError(f"no setting {key} in preset {preset}")
        changed[name] = value
    return train_config(merged(data, with_current_names(changes)), "sweep")
