"""`footfall train`."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from footfall.learning import learning_wing
from footfall.options import Count, RobotName, Seed
from robots.errors import UserError

EVALUATION = "gentle"  # the scenario that every finished run goes through
OF_ANY_RUN = {"resume", "evaluate"}


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
    evaluate: bool = True
    """Walk the finished policy over the simulated bus, into RUN/evaluation.json."""


def train(*, options: TrainOptions = TrainOptions()) -> None:
    """Train a policy; RUN/policy.onnx is there when it ends."""
    wing = learning_wing()
    if options.resume is not None:
        _refuse_other_options(options)
        run = wing.open_run(wing.resume(options.resume))
    else:
        request = wing.TrainRequest(options.robot, options.preset, options.seed, options.out, options.steps)
        run = wing.open_run(wing.train(request))
    if options.evaluate:
        from evaluate.api import evaluate_policy

        evaluate_policy(
            str(run.folder),
            run.provenance.robot,
            (EVALUATION,),
            seed=run.provenance.seed,
            json_path=run.folder / "evaluation.json",
        )


def _refuse_other_options(options: TrainOptions) -> None:
    nominal = TrainOptions()
    for field in fields(options):
        if field.name not in OF_ANY_RUN and getattr(options, field.name) != getattr(nominal, field.name):
            raise UserError(f"--resume brings the run's own settings: leave --{field.name} out")
