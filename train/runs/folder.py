"""A run folder: configuration, provenance, metrics, checkpoints, policy. Always consistent."""

import fcntl
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

from footfall.common.config import dump, load
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.robots.description import Robot, load_robot
from footfall.train.config import TrainConfig, read_config

LOCK = ".lock"
START = "start"  # stem of the copied file of networks
TEMPORARY = (".config.yaml.", ".run.yaml.", f".{START}.")  # prefixes of files that are being written


@dataclass(frozen=True)
class Origin:
    """Networks that a training started from."""

    file: str  # the checkpoint or policy
    sha256: str  # of that file
    robot: str
    robot_digest: str  # of the description that they were trained on
    changed: tuple[str, ...] = ()  # fields of the contract that have changed


@dataclass(frozen=True)
class Provenance:
    """The content of run.yaml: robot, seed, preset, trainer, device, versions, and what it started from."""

    robot: str
    seed: int
    preset: str
    trainer: str  # its name, or MODULE:NAME
    device: str
    revision: str
    created: str
    versions: dict[str, str]
    robot_digest: str = ""  # digest of the robot's description; empty in older runs
    started_from: Origin | None = None  # another run's or policy's networks; None: from the seed


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

    @property
    def start(self) -> Path | None:
        """The copied file of the networks that it starts from; None: from the seed."""
        origin = self.provenance.started_from
        return None if origin is None else self.folder / f"{START}{Path(origin.file).suffix}"


def create_run(folder: Path, provenance: Provenance, config: TrainConfig) -> Run:
    """Make a run folder, with a copy of the networks that it starts from.

    Raises:
        UserError: the folder holds a run or other files, or cannot be written.
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
        run = Run(folder, provenance, config)
        if run.start is not None and provenance.started_from is not None:
            write_atomically(run.start, Path(provenance.started_from.file).read_bytes())
        write_atomically(folder / "config.yaml", dump(config).encode())
        # Last: a folder with run.yaml is complete.
        write_atomically(folder / "run.yaml", dump(provenance).encode())
    except OSError as error:
        raise UserError(f"cannot write to {folder}: {error.strerror}") from None
    return run


def _is_leftover(path: Path) -> bool:
    """Whether this file belongs to a run that was killed before its folder was complete."""
    return path.name == "config.yaml" or path.name.startswith((*TEMPORARY, f"{START}."))


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
    """The robot of a run; its description must not have changed since the training began.

    Raises:
        UserError: there is no such robot, or its description has changed.
    """
    robot = load_robot(provenance.robot)
    if provenance.robot_digest not in ("", robot.digest):
        raise UserError(
            f"robot '{provenance.robot}' has changed since this training began (description"
            f" {provenance.robot_digest} then, {robot.digest} now): undo the change, or train a new run"
        )
    return robot


def locked(run: Run) -> AbstractContextManager:
    """Lock a run for this process, until the `with` block or the process ends.

    Raises:
        UserError: another process trains it.
    """
    try:
        file = (run.folder / LOCK).open("ab")
    except OSError:
        return nullcontext()  # the folder cannot be written, which the first file to write will report
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise UserError(f"{run.folder} is being trained by another process: wait for it or stop it") from None
    except OSError:
        pass  # a file system without locks
    return file
