"""The protocol of a trainer."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar, Protocol

from footfall.robots.description import Robot
from footfall.train.config import TrainConfig
from footfall.train.runs.diagnosis import Diagnosis
from footfall.train.runs.failure import Failure
from footfall.train.runs.folder import Run

Metrics = Mapping[str, Any]  # scalars by name; where they are JAX arrays, a device may still compute them


class Trainer(Protocol):
    """One training, which advances by whole iterations; a checkpoint holds everything that later iterations
    depend on.

    A class of your own (`--trainer MODULE:NAME`) derives from this one, which gives it the defaults below. It
    implements `__init__`, `restore`, `prepare`, `iterate`, `save` and `export`.

    If several processes train together, all of them call the same methods in the same order.
    """

    # Exceptions that a lost or exhausted device raises.
    device_errors: ClassVar[tuple[type[Exception], ...]] = ()
    max_devices: ClassVar[int | None] = 1  # devices it can use; None: all devices of all processes
    # Packages whose versions run.yaml records, besides the common ones.
    packages: ClassVar[tuple[str, ...]] = ()
    can_diagnose: ClassVar[bool] = False  # whether `diagnose` is implemented
    can_start_from: ClassVar[bool] = False  # whether `start_from` is implemented

    iteration: int = 0  # iterations done; the device may still compute the last one

    def __init__(self, run: Run, robot: Robot) -> None:
        """Build environment and networks.

        Raises:
            UserError: the settings do not fit the robot.
        """

    def restore(self, path: Path) -> None:
        """Load a checkpoint; `export` works afterwards, without `prepare`.

        Raises:
            UserError: the file is damaged or belongs to another configuration.
        """

    def start_from(self, path: Path) -> list[str]:
        """Take over the networks of another training; called after `prepare` (`train/origin.py`).

        Args:
            path: a checkpoint of this trainer, or an exported policy.

        Returns:
            What was taken over, and what begins anew, one line each.

        Raises:
            UserError: the file is damaged, or its networks have other sizes.
        """
        raise NotImplementedError

    def prepare(self, report: Callable[[str], None]) -> None:
        """Compile, and start from the restored state, or from the run's seed if there is none.

        Args:
            report: shows one line to the user.

        Raises:
            UserError: the settings do not fit the devices.
        """

    def iterate(self) -> Metrics:
        """Roll out and learn once; may return before the device has finished.

        Raises:
            TrainingFailedError: a value is not finite.
        """

    def save(self) -> None:
        """Write a checkpoint (`runs/checkpoint.py`).

        Raises:
            CannotWriteError: the disk is full or the folder cannot be written; older checkpoints stay.
            TrainingFailedError: the state is not finite.
        """

    def export(self, path: Path) -> float:
        """Write the policy; returns and raises as `footfall.train.export.export`."""

    @classmethod
    def metric_names(cls, config: TrainConfig, robot: Robot) -> list[str] | None:
        """Names of the metrics that `iterate` returns; None: unknown before a training runs."""
        return None

    @classmethod
    def diagnose(cls, failure: Failure, run: Run, robot: Robot, report: Callable[[str], None]) -> Diagnosis:
        """Compute a failed iteration again, step by step, to the first value that is not finite.

        Args:
            failure: the report of the failed run.
            run: its folder and settings.
            robot: its robot.
            report: shows one line to the user.
        """
        raise NotImplementedError
