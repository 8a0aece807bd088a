"""`footfall train`."""

from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, fields
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.options import Count, Index, RobotName, Seconds, Seed
from footfall.train.entry import learning_wing, start_device
from footfall.verbs.watch import LOCAL_PAGE, PageOptions

EVALUATION = "gentle"  # the scenario that every finished run goes through
OF_ANY_RUN = {"resume", "evaluate", "watch"}


@Parameter(name="*")
@dataclass(frozen=True)
class TrainOptions:
    """What to train."""

    robot: RobotName = "go1"
    preset: str = "cpu"
    """smoke (seconds), cpu (minutes), gpu-quick (a minute), gpu, or a YAML file of the same form."""
    seed: Seed = 0
    out: Path | None = None
    """Run folder to make (default: runs/ROBOT-PRESET-SEED-TIME)."""
    steps: Annotated[Count | None, Parameter(show_default=False)] = None
    """Environment steps, instead of the preset's."""
    checkpoint_interval: Annotated[Seconds | None, Parameter(show_default=False)] = None
    """Seconds between checkpoints, instead of the preset's."""
    trainer: Literal["brax", "rsl_rl"] = "brax"
    """Who learns: our JAX loop of brax's parts, or rsl_rl's runner (an extra)."""
    resume: Path | None = None
    """Run folder to continue from its last checkpoint; it brings its own settings."""
    evaluate: bool = True
    """Walk the finished policy over the simulated bus, into RUN/evaluation.json."""
    watch: bool = False
    """Show the newest checkpoint walking beside the curves, on a web page (of the first process, where there
    are several), until the training ends."""


@Parameter(name="*")
@dataclass(frozen=True)
class ClusterOptions:
    """Training in several processes, usually one per host: the same command in each, but for --process."""

    coordinator: Annotated[str | None, Parameter(show_default=False)] = None
    """HOST:PORT of process 0, or auto under Slurm, MPI or Kubernetes."""
    processes: Annotated[Count | None, Parameter(show_default=False)] = None
    """How many processes there are."""
    process: Annotated[Index | None, Parameter(show_default=False)] = None
    """Which of them this is, from 0."""


ALONE = ClusterOptions()


def train(
    *,
    options: TrainOptions = TrainOptions(),
    cluster: ClusterOptions = ALONE,
    page: PageOptions = LOCAL_PAGE,
) -> None:
    """Train a policy; RUN/policy.onnx is there when it ends."""
    if page != LOCAL_PAGE and not options.watch:
        raise UserError("--host and --port are for the page: add --watch, or leave them out")
    if options.resume is not None:
        _refuse_other_options(options)
    if cluster == ALONE:
        if options.resume is not None:
            from footfall.train.runs.folder import open_run

            open_run(options.resume)  # a mistyped folder is known before the wait for a GPU
        start_device()
    wing = learning_wing()
    if options.watch and _is_known_to_lead(cluster):
        from footfall.pages.page import check_page

        check_page(page.host, page.port)
    if cluster != ALONE:
        _join(wing, cluster)
    if options.resume is not None:
        folder = wing.open_run(options.resume).folder
    else:
        folder = wing.begin(_request(wing, options))
    with _watched(folder, page) if options.watch and wing.cluster.leads() else nullcontext():
        run = wing.open_run(wing.resume(folder))
    if options.evaluate and wing.cluster.leads():
        from footfall.evaluate.api import evaluate_policy

        evaluate_policy(
            str(run.folder),
            run.provenance.robot,
            (EVALUATION,),
            seed=run.provenance.seed,
            json_path=run.folder / "evaluation.json",
        )


def _is_known_to_lead(cluster: ClusterOptions) -> bool:
    """Before joining; which process leads under "auto" is known after it only."""
    return cluster.coordinator != "auto" and cluster.process in (None, 0)


def _join(wing: ModuleType, cluster: ClusterOptions) -> None:
    given = cluster.processes is not None and cluster.process is not None
    if cluster.coordinator is None or given == (cluster.coordinator == "auto"):
        raise UserError(
            "several processes need --coordinator HOST:PORT, --processes and --process, or --coordinator auto"
        )
    wing.cluster.join(cluster.coordinator, cluster.processes, cluster.process)


def _request(wing: ModuleType, options: TrainOptions) -> Any:
    return wing.TrainRequest(
        robot=options.robot,
        preset=options.preset,
        seed=options.seed,
        out=options.out,
        total_steps=options.steps,
        checkpoint_interval_s=options.checkpoint_interval,
        trainer=options.trainer,
    )


def _watched(folder: Path, page: PageOptions) -> AbstractContextManager[None]:
    from footfall.pages.beside import watched

    print(f"watch it learn at {page.address}, and afterwards with: footfall watch {folder}", flush=True)
    return watched(folder, page.host, page.port)


def _refuse_other_options(options: TrainOptions) -> None:
    nominal = TrainOptions()
    for field in fields(options):
        if field.name not in OF_ANY_RUN and getattr(options, field.name) != getattr(nominal, field.name):
            option = field.name.replace("_", "-")
            raise UserError(f"--resume brings the run's own settings: leave --{option} out")
