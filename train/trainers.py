"""The trainers by name; a user's own is named MODULE:NAME."""

import os
from importlib import import_module
from typing import NamedTuple

from footfall.common.collector import lasting_objects
from footfall.common.errors import UserError
from footfall.common.installation import needs_extra
from footfall.common.outside import find, is_import_path
from footfall.robots.description import Robot
from footfall.train.config import TrainConfig
from footfall.train.trainer import Trainer

DEFAULT_TRAINER = "brax"


class _Shipped(NamedTuple):
    """Where a trainer of footfall is; it is imported when it is needed."""

    module: str
    name: str
    extra: str  # extra of the package that installs the trainer's libraries
    prefetch: str = ""  # module whose `prefetch_programs` begins to read compiled programs


TRAINERS = {
    "brax": _Shipped("footfall.train.brax.trainer", "BraxTrainer", "train", "footfall.train.brax.prefetch"),
    "rsl_rl": _Shipped("footfall.train.rsl_rl.trainer", "RslRlTrainer", "rsl-rl"),
}
_REQUIRED = ("restore", "prepare", "iterate", "save", "export")


def prefetch(name: str, robot: Robot, config: TrainConfig) -> None:
    """Start reading the compiled programs of an earlier training, if this trainer keeps them.

    Raises:
        UserError: a module of the user's own cannot be imported.
    """
    if name in TRAINERS and TRAINERS[name].prefetch:
        import_module(TRAINERS[name].prefetch).prefetch_programs(robot, config)


def find_trainer(name: str) -> type[Trainer]:
    """The class of a trainer.

    Args:
        name: one of `TRAINERS`, or MODULE:NAME of a class that derives from `Trainer`.

    Raises:
        UserError: there is no such trainer, or its libraries are not installed.
    """
    if name in TRAINERS:
        module, attribute, extra, _ = TRAINERS[name]
        os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")  # rsl_rl imports GitPython: git may be missing
        with needs_extra(extra, f"the trainer {name} needs"), lasting_objects():
            return getattr(import_module(module), attribute)
    if not is_import_path(name):
        raise UserError(f"no trainer '{name}': give one of {', '.join(TRAINERS)}, or MODULE:NAME of your own")
    trainer = find(name, "trainer")
    if not isinstance(trainer, type):
        raise UserError(f"no trainer '{name}': it is not a class")
    bases = [base for base in trainer.__mro__ if base is not Trainer]
    missing = [method for method in _REQUIRED if not any(method in vars(base) for base in bases)]
    if missing or Trainer not in trainer.__mro__:
        raise UserError(
            f"'{name}' is not a trainer: it must derive from footfall.train.trainer.Trainer and implement"
            f" {', '.join(_REQUIRED)}"
        )
    return trainer
