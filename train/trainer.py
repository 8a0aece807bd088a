"""What a trainer is to the rest, and which there are."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol

from footfall.common.installation import needs_extra
from footfall.robots.description import Robot
from footfall.train.runs.folder import Run, TrainerName

Metrics = Mapping[str, Any]  # scalars by name; where they are arrays, a device may still compute them


class Trainer(Protocol):
    """One training, which advances by whole iterations; all that they depend on goes into a checkpoint.

    Of several processes that train together each one calls the same methods in the same order.
    """

    iteration: int  # iterations done; the device may still be at work on the last one
    device_errors: ClassVar[tuple[type[Exception], ...]]  # what a lost or exhausted device raises

    def __init__(self, run: Run, robot: Robot) -> None: ...

    @staticmethod
    def prefetch(run: Run, robot: Robot) -> None:
        """Begin to read what an earlier process compiled, beside what comes before `prepare`."""

    def restore(self, path: Path) -> None:
        """Take over a checkpoint's state; enough for an export.

        Raises:
            UserError: the file is damaged or belongs to another configuration.
        """

    def prepare(self, say: Callable[[str], None]) -> None:
        """Make ready to iterate from the restored state, or else from the run's seed.

        Args:
            say: told what a user should know.

        Raises:
            UserError: the configuration does not fit the devices.
        """

    def iterate(self) -> Metrics:
        """Roll out and learn once; may return before it is computed.

        Raises:
            UserError: the training has failed.
        """

    def save(self) -> None:
        """Write a checkpoint.

        Raises:
            CannotWriteError: the disk is full or the folder cannot be written; older checkpoints stay.
            UserError: the state is not finite.
        """

    def export(self, path: Path) -> float:
        """Write the policy; returns and raises as `footfall.train.export.export`."""


@dataclass(frozen=True)
class TrainerKind:
    """What is known of a trainer without importing it."""

    load: Callable[[], type[Trainer]]  # raises UserError if its libraries are missing
    devices: int | None = None  # that it trains on; None: all that there are, of any number of processes
    packages: tuple[str, ...] = ()  # whose versions a run keeps besides those of every run
    replayable: bool = False  # whether a failed iteration can be computed again step by step


def _brax() -> type[Trainer]:
    from footfall.train.brax.trainer import BraxTrainer

    return BraxTrainer


def _rsl_rl() -> type[Trainer]:
    os.environ.setdefault("GIT_PYTHON_REFRESH", "quiet")  # upstream imports GitPython: git may be missing
    with needs_extra("rsl-rl", "the trainer rsl_rl needs"):
        from footfall.train.rsl_rl.trainer import RslRlTrainer
    return RslRlTrainer


TRAINERS: dict[TrainerName, TrainerKind] = {
    "brax": TrainerKind(_brax, replayable=True),
    "rsl_rl": TrainerKind(_rsl_rl, devices=1, packages=("torch", "rsl-rl-lib", "tensordict")),
}
