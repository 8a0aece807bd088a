"""A run folder: configuration, provenance, metrics, checkpoints, policy. Always consistent."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from robots.config import dump, load
from robots.errors import UserError
from robots.files import write_atomically
from train.config import TrainConfig

Trainer = Literal["brax", "rsl_rl"]


@dataclass(frozen=True)
class Provenance:
    """How a run came about: the content of run.yaml."""

    robot: str
    seed: int
    preset: str
    trainer: Trainer
    device: str
    revision: str
    created: str
    versions: dict[str, str]


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
        UserError: it holds a run already, or cannot be written.
    """
    if (folder / "run.yaml").exists():
        raise UserError(
            f"{folder} holds a run already: resume it with 'footfall train --resume {folder}'"
            " or give another --out"
        )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} exists and is not empty: give another --out")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / "config.yaml", dump(config).encode())
        # Last, so that a folder with run.yaml is a whole one.
        write_atomically(folder / "run.yaml", dump(provenance).encode())
    except OSError as error:
        raise UserError(f"cannot write to {folder}: {error.strerror}") from None
    return Run(folder, provenance, config)


def open_run(folder: Path) -> Run:
    """Open a run folder.

    Raises:
        UserError: there is none, or its files are damaged.
    """
    if not (folder / "run.yaml").is_file():
        raise UserError(f"no run at {folder}: expected a folder that 'footfall train' made")
    provenance = load(folder / "run.yaml", Provenance)
    return Run(folder, provenance, load(folder / "config.yaml", TrainConfig))
