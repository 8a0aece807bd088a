"""A run folder: configuration, provenance, metrics, checkpoints, policy. Always consistent."""

import fcntl
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from footfall.common.config import dump, load
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.robots.description import Robot, load_robot
from footfall.train.config import TrainConfig, read_config

TrainerName = Literal["brax", "rsl_rl"]
LOCK = ".lock"
TEMPORARY = (".config.yaml.", ".run.yaml.")  # beginnings of names that atomic writing gives


@dataclass(frozen=True)
class Provenance:
    """How a run came about: the content of run.yaml."""

    robot: str
    seed: int
    preset: str
    trainer: TrainerName
    device: str
    revision: str
    created: str
    versions: dict[str, str]
    robot_digest: str = ""  # of the description that is trained on; runs of before have none


@dataclass(frozen=True)
class Run:
    """Paths and settings of one training."""

    folder: Path
    provenance: Provenance
    config: TrainConfig

    @property
    def checkpoints(self) -> Path:
        return self.folder / "checkpoints"

    @property
    def policy(self) -> Path:
        return self.folder / "policy.onnx"


def create_run(folder: Path, provenance: Provenance, config: TrainConfig) -> Run:
    """Make a run folder.

    Raises:
        UserError: it holds a run already or other files, or cannot be written.
    """
    if (folder / "run.yaml").exists():
        raise UserError(
            f"{folder} holds a run already: resume it with 'footfall train --resume {folder}'"
            " or give another --out"
        )
    if folder.exists() and (not folder.is_dir() or not all(map(_is_leftover, folder.iterdir()))):
        raise UserError(f"{folder} exists and is not empty: give another --out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for leftover in folder.iterdir():
            leftover.unlink()
        write_atomically(folder / "config.yaml", dump(config).encode())
        # Last, so that a folder with run.yaml is a whole one.
        write_atomically(folder / "run.yaml", dump(provenance).encode())
    except OSError as error:
        raise UserError(f"cannot write to {folder}: {error.strerror}") from None
    return Run(folder, provenance, config)


def _is_leftover(path: Path) -> bool:
    """Whether this is of a run that was killed before it was whole."""
    return path.name == "config.yaml" or path.name.startswith(TEMPORARY)


def open_run(folder: Path) -> Run:
    """Open a run folder.

    Raises:
        UserError: there is none, or its files are damaged.
    """
    if not (folder / "run.yaml").is_file():
        raise UserError(f"no run at {folder}: expected a folder that 'footfall train' made")
    provenance = load(folder / "run.yaml", Provenance)
    return Run(folder, provenance, read_config(folder / "config.yaml"))


def trained_robot(provenance: Provenance) -> Robot:
    """The robot of a run, whose description must still be the one that it was trained on.

    Raises:
        UserError: there is no such robot any more, or its description has changed.
    """
    robot = load_robot(provenance.robot)
    if provenance.robot_digest not in ("", robot.digest):
        raise UserError(
            f"robot '{provenance.robot}' has changed since this training began (description"
            f" {provenance.robot_digest} then, {robot.digest} now): undo the change, or train a new run"
        )
    return robot


def locked(run: Run) -> AbstractContextManager:
    """Keep a run for this process; let go with `with`, or by ending in any way: the kernel sees to it.

    Raises:
        UserError: another process trains it.
    """
    try:
        file = (run.folder / LOCK).open("ab")
    except OSError:
        return nullcontext()  # a folder that cannot be written: what has to be written will say so
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise UserError(f"{run.folder} is being trained by another process: wait for it or stop it") from None
    except OSError:
        pass  # a file system without locks
    return file
