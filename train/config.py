"""Settings of a training, as written in a preset or in a run folder's config.yaml."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from footfall.common.config import (
    by_label,
    merged,
    read_yaml,
    require_between,
    require_not_negative,
    require_positive,
    structure,
    unstructure,
)
from footfall.common.errors import UserError
from footfall.common.hints import did_you_mean
from footfall.domain_rand.randomisation import affects_policies, default_ranges, own_ranges
from footfall.envs.config import TERM_LISTS, EnvConfig, default_terms, with_lists
from footfall.envs.old_settings import SCALES, SECTIONS
from footfall.robots.description import Robot
from footfall.train.copied import adapted_copy, differences
from footfall.train.old_names import with_current_names

PRESETS = Path(__file__).parent / "presets"
TRAINING_FILE = "training.yaml"  # in a robot's folder
BASE = "base"  # key of a preset's file: the shipped preset that the file changes


@dataclass(frozen=True)
class PpoConfig:
    """PPO's settings. One iteration is num_envs * num_steps_per_env environment steps."""

    total_steps: int  # environment steps of the whole training
    num_envs: int  # on all devices together; a multiple of num_mini_batches times the devices
    num_steps_per_env: int  # length of a rollout, control steps
    num_mini_batches: int  # mini-batches in an epoch
    num_learning_epochs: int  # epochs over each rollout
    learning_rate: float  # Adam's, at the start
    final_learning_rate: float  # at the end; it falls linearly
    gamma: float  # discount of a control step
    lam: float  # lambda of generalised advantage estimation
    clip_param: float  # clipping of the probability ratio, which stays within 1 ± this
    entropy_coef: float  # weight of the entropy, which keeps the policy exploring
    max_grad_norm: float  # longer gradients are scaled down to this
    init_noise_std: float  # standard deviation of the actions at the start
    actor_hidden_dims: tuple[int, ...]  # units of each hidden layer
    critic_hidden_dims: tuple[int, ...]  # the same for the critic
    final_entropy_coef: float | None = None  # at the end, falling linearly; None: constant
    # Target KL divergence: the learning rate adapts to it, below its falling limit.
    desired_kl: float | None = None
    bfloat16: bool = False  # hidden layers compute in 16 bits; parameters, losses and exports stay float32
    symmetry: bool = False  # learn from mirror images too; the robot must be symmetric left and right

    def __post_init__(self) -> None:
        require_positive(
            self, "total_steps", "num_envs", "num_steps_per_env", "num_mini_batches", "num_learning_epochs"
        )
        require_positive(self, "learning_rate", "desired_kl", "clip_param", "max_grad_norm", "init_noise_std")
        require_between(self, 0.0, 1.0, "learning_rate", "final_learning_rate")
        require_between(self, 0.0, 100.0, "desired_kl", "clip_param", "init_noise_std")
        require_between(self, 0.0, 100.0, "entropy_coef", "final_entropy_coef")
        require_positive(self, "actor_hidden_dims", "critic_hidden_dims")
        require_between(self, 0.0, 1.0, "gamma", "lam")
        if not self.actor_hidden_dims or not self.critic_hidden_dims:
            raise ValueError("actor_hidden_dims and critic_hidden_dims need a hidden layer at least")
        if self.num_envs % self.num_mini_batches:
            raise ValueError(
                f"num_envs {self.num_envs} is not a multiple of num_mini_batches {self.num_mini_batches}"
            )

    @property
    def steps_per_iteration(self) -> int:
        return self.num_envs * self.num_steps_per_env

    @property
    def iterations(self) -> int:
        return max(1, -(-self.total_steps // self.steps_per_iteration))

    def learning_rate_limit(self, iteration: Any) -> Any:
        """The learning rate, or its upper limit where it adapts: falls linearly over the training.

        Args:
            iteration: iterations done, a float32 scalar.
        """
        share = iteration / self.iterations
        return self.learning_rate + share * (self.final_learning_rate - self.learning_rate)

    def entropy_weight(self, iteration: Any) -> Any:
        """The weight of the entropy after `iteration` iterations, as in `learning_rate_limit`."""
        if self.final_entropy_coef is None:
            return self.entropy_coef
        share = iteration / self.iterations
        return self.entropy_coef + share * (self.final_entropy_coef - self.entropy_coef)


@dataclass(frozen=True)
class TrainConfig:
    """All settings of a training, except the robot and the seed."""

    ppo: PpoConfig
    env: EnvConfig
    checkpoint_interval_s: float = 30.0  # of the wall clock; 0 for every iteration
    diverged_limit: float = 0.01  # share of control steps whose simulation may diverge before training stops
    training_yaml: bool = True  # whether a robot's training.yaml, which is about walking, changes this preset

    def __post_init__(self) -> None:
        require_not_negative(self, "checkpoint_interval_s")


def available_presets() -> list[str]:
    """Names of the presets that ship with footfall."""
    return sorted(path.stem for path in PRESETS.glob("*.yaml"))


def read_preset(name: str) -> dict[str, Any]:
    """The settings of a preset that ships with footfall, merged over its base's settings if it has a base."""
    path = PRESETS / f"{name}.yaml"
    settings: dict[str, Any] = read_yaml(path)
    base = settings.pop(BASE, None)
    return settings if base is None else _merged(read_preset(base), settings, str(path))


def load_preset(name_or_file: str, robot: Robot | None = None) -> TrainConfig:
    """A preset by name, or a YAML file of the same form.

    A file that begins with `base: NAME` holds only what it changes of that preset (see `merged`). Any other
    file counts as an edited copy of the most similar shipped preset. A file that contains every setting,
    such as a run's config.yaml, is used unchanged.

    Args:
        name_or_file: a name, or a path.
        robot: its own ranges of randomised quantities, and then its `training.yaml`, replace settings
            of the presets that ship with footfall, and the unedited settings of a copy.

    Raises:
        UserError: there is no such preset, or the file is malformed.
    """
    if name_or_file in available_presets():
        return train_config(*_adapted(name_or_file, robot))
    path = Path(name_or_file)
    if not path.is_file():
        raise UserError(
            f"no preset '{name_or_file}': give one of {', '.join(available_presets())} or a YAML file"
            f"{did_you_mean(name_or_file, available_presets())}"
        )
    changes = read_yaml(path)
    if not isinstance(changes, dict) or (robot is None and BASE not in changes):
        return train_config(changes, str(path))
    if BASE not in changes:
        return _copied(with_current_names(changes), path, robot)
    base = changes.pop(BASE)
    if base not in available_presets():
        raise UserError(f"{path}: {BASE}: no preset '{base}': there are {', '.join(available_presets())}")
    settings, source = _adapted(base, robot, changes)
    return train_config(_merged(settings, changes, str(path)), f"{path} over {source}")


def _copied(settings: dict[str, Any], path: Path, robot: Robot | None) -> TrainConfig:
    """Settings of a file that has no base."""
    env = settings.get("env")
    if not isinstance(env, dict) or {each.name for each in fields(EnvConfig)} <= env.keys():
        return train_config(settings, str(path))
    settings = settings | {"env": with_lists(env)}
    originals = {name: read_preset(name) for name in available_presets()}
    nearest = min(originals, key=lambda name: differences(settings, originals[name]))
    adapted, source = _adapted(nearest, robot, settings)
    return train_config(adapted_copy(settings, originals[nearest], adapted), f"{path} over {source}")


def with_settings(config: TrainConfig, settings: dict[str, Any], source: str) -> TrainConfig:
    """Settings of a training with some replaced, named by dotted keys; a list of terms by the terms' names.

    Raises:
        UserError: there is no such setting, or a value does not fit it; the message names `source`.
            `training_yaml` acts only while a preset is loaded, and is refused here.
    """
    if "training_yaml" in settings:
        raise UserError(
            f"{source}: set training_yaml in a preset's file: it acts only while the preset is loaded"
        )
    data = unstructure(config)
    changes: dict[str, Any] = {}
    for key, value in settings.items():
        *parents, name = key.split(".")
        section, changed = data, changes
        for parent in parents:
            section = by_label(section.get(parent)) if isinstance(section, dict) else None
            changed = changed.setdefault(parent, {})
        if not isinstance(section, dict) or (section is data and name not in data):
            raise UserError(f"{source}: no setting {key}{_hint(key, data)}")
        changed[name] = value
    return train_config(_merged(data, changes, source), source)


def _hint(key: str, data: dict[str, Any]) -> str:
    """A hint at the setting that a misspelt key may mean."""
    full_keys = [f"{part}.{name}" for part in ("ppo", "env") for name in data[part]]
    return did_you_mean(next((each for each in full_keys if each.endswith(f".{key}")), key), full_keys)


def _merged(settings: dict[str, Any], changes: Any, source: str) -> Any:
    """Settings with changes, which may use older names.

    Raises:
        UserError: changes of a list of terms name a term that is in no such list.
    """
    changes = with_current_names(changes)
    if isinstance(changes, dict):
        _check_names(settings["env"], changes.get("env"), source)
    return merged(settings, changes)


def _check_names(env: dict[str, Any], changes: Any, source: str) -> None:
    """Refuse misspelt names of terms: `merged_terms` would ignore settings of an unlisted term."""
    for part in TERM_LISTS if isinstance(changes, dict) else ():
        changed = changes.get(part)
        for name, entry in changed.items() if isinstance(changed, dict) else ():
            is_new_term = not isinstance(entry, dict) or {"term", "weight"} & entry.keys()
            if is_new_term or name in by_label(env.get(part) or []):
                continue
            known = _known_terms(part)
            if name not in known:
                raise UserError(f"{source}: env.{part}: no term '{name}'{did_you_mean(str(name), known)}")


def _known_terms(part: str) -> set[str]:
    """Names of the terms in a list of any shipped preset, or of older settings."""
    older = {term for of_part, term in SECTIONS.values() if of_part == part}
    older |= {term for term, _ in SCALES.values()} if part == "rewards" else set()
    paths = (PRESETS / f"{name}.yaml" for name in available_presets())
    lists = [read_yaml(path)["env"] for path in paths]
    return older.union(*(by_label(env.get(part) or default_terms(part)) for env in lists))


def _adapted(name: str, robot: Robot | None, user: Mapping[str, Any] | None = None) -> tuple[Any, str]:
    """The settings of a preset that ships with footfall, adapted to a robot, and the files they come from.

    Args:
        name: the preset's name.
        robot: its own settings replace the preset's; None: the preset is not adapted.
        user: settings of a user's file over the preset; its `training_yaml` wins over the preset's.
    """
    path = PRESETS / f"{name}.yaml"
    preset = read_preset(name)
    if robot is None:
        return preset, str(path)
    training_file = robot.folder / TRAINING_FILE
    preset = _with_own_ranges(preset, robot)
    uses_file = (preset | dict(user or {})).get("training_yaml", True)
    changes = read_yaml(training_file) if training_file.is_file() and uses_file else None
    if changes is None:
        return preset, str(path)
    return _merged(preset, changes, str(training_file)), f"{training_file} over {path}"


def read_config(path: Path) -> TrainConfig:
    """The settings in a preset's file or a run's config.yaml.

    Raises:
        UserError: the file cannot be read, or a setting is wrong.
    """
    return train_config(read_yaml(path), str(path))


def train_config(settings: Any, source: str) -> TrainConfig:
    """Settings of a training from plain data, which may use older names.

    Raises:
        UserError: a setting is wrong; the message names `source` and the setting.
    """
    current = with_current_names(settings)
    if isinstance(current, dict) and "env" in current:
        _check_names({}, current["env"], source)
        current = current | {"env": with_lists(current["env"])}
    return structure(current, TrainConfig, source)


def _with_own_ranges(preset: dict[str, Any], robot: Robot) -> dict[str, Any]:
    """A preset with the robot's own ranges of what it randomises, and of what only this robot has.

    The latter, such as torque lag, backlash or jitter, is not in domain_rand/default.yaml.
    """
    randomised = preset["env"].get("randomisation", {})
    defaults = default_ranges()
    robot_ranges = {
        name: unstructure(range_)
        for name, range_ in own_ranges(robot).items()
        if name in randomised or (randomised and name not in defaults and affects_policies(name))
    }
    return merged(preset, {"env": {"randomisation": robot_ranges}})
