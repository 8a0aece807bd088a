"""`footfall train`."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from footfall.learning import learning_wing
from footfall.options import Count, RobotName, Seed
from robots.errors import UserError


@Parameter(name="*")
@dataclass(frozen=True)
class TrainOptions:
    """What to train."""

    robot: RobotName = "go1"
    preset: str = "cpu"
    """smoke (seconds), cpu (minutes), gpu, or a YAML file of the same form."""
    seed: Seed = 0
    out: Path | None = None
    """Run folder to make (default: runs/ROBOT-PRESET-SEED-TIME)."""
    steps: Annotated[Count | None, Parameter(show_default=False)] = None
    """Environment steps, instead of the preset's."""
    resume: Path | None = None
    """Run folder to continue from its last checkpoint; it brings its own settings."""


def train(*, options: TrainOptions = TrainOptions()) -> None:
    """Train a policy; RUN/policy.onnx is there when it ends."""
    if options.resume is not None:
        _refuse_other_options(options)
        learning_wing().resume(options.resume)
        return
    wing = learning_wing()
    wing.train(wing.TrainRequest(options.robot, options.preset, options.seed, options.out, options.steps))


def _refuse_other_options(options: TrainOptions) -> None:
    nominal = TrainOptions()
    for field in fields(options):
        if field.name != "resume" and getattr(options, field.name) != getattr(nominal, field.name):
            raise UserError(f"--resume brings the run's own settings: leave --{field.name} out")
