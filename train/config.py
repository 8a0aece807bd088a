"""Settings of a training, as they stand in a preset or in a run folder's config.yaml."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from footfall.common.config import (
    load,
    merged,
    read_yaml,
    require_between,
    require_not_negative,
    require_positive,
    structure,
    unstructure,
    with_changes,
)
from footfall.common.errors import UserError
from footfall.domain_rand.randomisation import own_ranges
from footfall.envs.config import EnvConfig
from footfall.robots.description import Robot

PRESETS = Path(__file__).parent / "presets"
TRAINING_FILE = "training.yaml"  # in a robot's folder


@dataclass(frozen=True)
class PpoConfig:
    """PPO's settings. One iteration is environments * unroll environment steps."""

    total_steps: int
    environments: int
    unroll: int
    minibatches: int
    passes: int
    learning_rate: float
    final_learning_rate: float
    discount: float
    gae_lambda: float
    clip: float
    entropy: float
    gradient_norm: float
    initial_std: float
    actor_layers: tuple[int, ...]
    critic_layers: tuple[int, ...]
    desired_kl: float | None = None  # adapts the learning rate below its falling limit
    bfloat16: bool = False  # hidden layers compute in 16 bits; parameters, losses and exports stay float32
    symmetry: bool = False  # learn from mirror images too; the robot must be the same left and right

    def __post_init__(self) -> None:
        require_positive(self, "total_steps", "environments", "unroll", "minibatches", "passes")
        require_positive(self, "learning_rate", "desired_kl", "clip", "gradient_norm", "initial_std")
        require_between(self, 0.0, 1.0, "learning_rate", "final_learning_rate")
        require_between(self, 0.0, 100.0, "desired_kl", "clip", "entropy", "initial_std")
        require_positive(self, "actor_layers", "critic_layers")
        require_between(self, 0.0, 1.0, "discount", "gae_lambda")
        if not self.actor_layers or not self.critic_layers:
            raise ValueError("actor_layers and critic_layers need a hidden layer at least")
        if self.environments % self.minibatches:
            raise ValueError(
                f"environments {self.environments} is not a multiple of minibatches {self.minibatches}"
            )

    @property
    def steps_per_iteration(self) -> int:
        return self.environments * self.unroll

    @property
    def iterations(self) -> int:
        return max(1, -(-self.total_steps // self.steps_per_iteration))


@dataclass(frozen=True)
class TrainConfig:
    """All settings of a training, but for the robot and the seed."""

    ppo: PpoConfig
    env: EnvConfig
    checkpoint_interval_s: float = 30.0
    diverged_limit: float = 0.01  # share of control steps whose simulation may diverge, before training stops

    def __post_init__(self) -> None:
        require_not_negative(self, "checkpoint_interval_s")


def available_presets() -> list[str]:
    """Names of the presets that ship with footfall."""
    return sorted(path.stem for path in PRESETS.glob("*.yaml"))


def load_preset(name_or_file: str, robot: Robot | None = None) -> TrainConfig:
    """A preset by name, or a YAML file of the same form.

    Args:
        name_or_file: a name, or a path.
        robot: whose own ranges of what a preset randomises, and then its `training.yaml`, replace settings
            of the presets that ship with footfall. A file is taken as it is.

    Raises:
        UserError: there is no such preset, or the file is malformed.
    """
    path = PRESETS / f"{name_or_file}.yaml"
    if path.is_file() and robot is not None:
        own = robot.folder / TRAINING_FILE
        preset = _with_own_ranges(read_yaml(path), robot)
        if not own.is_file():
            return structure(preset, TrainConfig, str(path))
        return structure(with_changes(preset, own), TrainConfig, f"{own} over {path}")
    if not path.is_file():
        path = Path(name_or_file)
    if not path.is_file():
        raise UserError(
            f"no preset '{name_or_file}': give one of {', '.join(available_presets())} or a YAML file"
        )
    return load(path, TrainConfig)


def _with_own_ranges(preset: dict[str, Any], robot: Robot) -> dict[str, Any]:
    """A preset that draws what it randomises from the robot's own ranges."""
    randomised = preset["env"].get("randomisation", {})
    own = {name: unstructure(range_) for name, range_ in own_ranges(robot).items() if name in randomised}
    return merged(preset, {"env": {"randomisation": own}})
