"""`footfall train`."""

import re
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.common.yaml_text import parse_yaml
from footfall.evaluation_options import report_failures
from footfall.options import (
    AS_TYPED,
    Count,
    Index,
    OptionalPath,
    PresetSettings,
    RobotName,
    Seconds,
    Seed,
)
from footfall.robots.default import DEFAULT_ROBOT
from footfall.train.entry import learning_libraries, start_device
from footfall.verbs.watch import LOCAL_PAGE, PageOptions

EVALUATION = "gentle"  # scenario for every finished run
OPTION_NAMES = {"settings": "set", "start": "from"}  # option names that differ from their fields
ALLOWED_WITH_RESUME = {"resume", "evaluate", "watch"}  # options that --resume permits
ROBOT_HELP = f"Name of a robot, or a folder with its robot.yaml (default: {DEFAULT_ROBOT})."
COORDINATOR = re.compile(r"(\[[0-9a-fA-F:.]+\]|[^:\[\]\s]+):(?P<port>[0-9]{1,5})")


@Parameter(name="*")
@dataclass(frozen=True)
class TrainOptions:
    """Settings of a training. None: the default of `footfall.train.api.TrainRequest`, or the resumed run's
    value."""

    robot: Annotated[RobotName | None, AS_TYPED, Parameter(show_default=False, help=ROBOT_HELP)] = None
    preset: Annotated[str | None, AS_TYPED, Parameter(show_default=False)] = None
    """smoke (seconds), cpu (minutes, the default), gpu-quick (a minute), gpu, rough, rough-blind, or a YAML
    file of the same form."""
    seed: Annotated[Seed | None, Parameter(show_default=False)] = None
    """The same seed gives the same result on the same machine (default: 0)."""
    out: OptionalPath = None
    """Run folder to create (default: runs/ROBOT-PRESET-SEED-TIME)."""
    steps: Annotated[Count | None, Parameter(show_default=False)] = None
    """Environment steps, replacing the preset's."""
    checkpoint_interval: Annotated[Seconds | None, AS_TYPED, Parameter(show_default=False)] = None
    """Seconds between checkpoints, replacing the preset's."""
    settings: PresetSettings = ()
    trainer: Annotated[str | None, AS_TYPED, Parameter(show_default=False)] = None
    """brax (the default), rsl_rl (an extra), or MODULE:NAME of your own trainer."""
    resume: OptionalPath = None
    """Run folder to continue from its last checkpoint, with its own settings."""
    start: Annotated[str | None, AS_TYPED, Parameter(name="--from", show_default=False)] = None
    """Fine-tune: start from the networks of a run folder or a learned policy (go1-flat, an .onnx file)."""
    evaluate: bool = True
    """Evaluate the finished policy over the simulated bus; results are in RUN/evaluation.json."""
    watch: bool = False
    """Show the newest checkpoint and the training curves on a web page, until the training ends."""


@Parameter(name="*")
@dataclass(frozen=True)
class ClusterOptions:
    """Training in several processes, usually one per host: the same command for all except --process."""

    coordinator: Annotated[str | None, AS_TYPED, Parameter(show_default=False)] = None
    """HOST:PORT of process 0, or auto under Slurm, MPI or Kubernetes."""
    processes: Annotated[Count | None, Parameter(show_default=False)] = None
    """Number of processes."""
    process: Annotated[Index | None, Parameter(show_default=False)] = None
    """Index of this process, from 0."""


ALONE = ClusterOptions()


def train(
    *,
    options: TrainOptions = TrainOptions(),
    cluster: ClusterOptions = ALONE,
    page: PageOptions = LOCAL_PAGE,
) -> int:
    """Train a policy and export it to RUN/policy.onnx. Exit 1 if its evaluation fails to run."""
    from footfall.train.runs.folder import open_run

    if page != LOCAL_PAGE and not options.watch:
        raise UserError("--host and --port are for the page: add --watch, or leave them out")
    _check_cluster(cluster)
    if options.resume is not None:
        _refuse_other_options(options)
    _check_evaluation(options)
    if cluster == ALONE:
        if options.resume is not None:
            open_run(options.resume)  # detects a mistyped folder before the wait for a GPU
        start_device()
    with learning_libraries():
        from footfall.train import api
    if options.watch and _may_be_main_process(cluster):
        from footfall.pages.page import check_page

        check_page(page.host, page.port)
    if cluster.coordinator is not None:
        api.cluster.join(cluster.coordinator, cluster.processes, cluster.process)
    folder = options.resume or api.begin(api.TrainRequest(**_requested(options)))
    main = api.cluster.is_main_process()
    with _watched(folder, page) if options.watch and main else nullcontext():
        api.resume(folder)
    return _evaluate(folder) if options.evaluate and main else 0


def _check_evaluation(options: TrainOptions) -> None:
    """Refuse a robot with safety limits that would end the evaluation, before hours of training."""
    from footfall.deploy.config import deploy_config
    from footfall.robots.description import load_robot

    if options.evaluate and options.resume is None:
        deploy_config(load_robot(options.robot or DEFAULT_ROBOT))


def _evaluate(folder: Path) -> int:
    """Evaluate a run's policy, unless that is already done; returns the exit status."""
    from footfall.evaluate.api import evaluate_policy
    from footfall.evaluate.config import EvaluationConfig
    from footfall.train.runs.folder import open_run

    run = open_run(folder)
    result_file = folder / "evaluation.json"
    if result_file.is_file() and result_file.stat().st_mtime_ns >= run.policy.stat().st_mtime_ns:
        return 0
    config = EvaluationConfig(run.provenance.robot, (EVALUATION,), run.provenance.seed)
    result = evaluate_policy(str(folder), config, json_path=result_file)
    return report_failures({str(folder): result})


def _may_be_main_process(cluster: ClusterOptions) -> bool:
    """Whether this process may be the main one; under "auto" this is known only after joining."""
    return cluster.coordinator != "auto" and cluster.process in (None, 0)


def _check_cluster(cluster: ClusterOptions) -> None:
    """Refuse incomplete or invalid cluster options before any waiting."""
    if cluster == ALONE:
        return
    processes_given = cluster.processes is not None and cluster.process is not None
    if cluster.coordinator is None or processes_given == (cluster.coordinator == "auto"):
        raise UserError(
            "several processes need --coordinator HOST:PORT, --processes and --process, or --coordinator auto"
        )
    address = COORDINATOR.fullmatch(cluster.coordinator)
    if cluster.coordinator != "auto" and not (address and 0 < int(address["port"]) < 2**16):
        raise UserError(f"--coordinator: expected HOST:PORT or auto, found '{cluster.coordinator}'")
    processes, process = cluster.processes, cluster.process
    if processes is not None and process is not None and process >= processes:
        raise UserError(f"--process counts from 0: the last of {processes} is {processes - 1}")


def _requested(options: TrainOptions) -> dict[str, Any]:
    """Options given by the user, by the names in `TrainRequest`."""
    requested = {
        "robot": options.robot,
        "preset": options.preset,
        "seed": options.seed,
        "out": options.out,
        "total_steps": options.steps,
        "checkpoint_interval_s": options.checkpoint_interval,
        "trainer": options.trainer,
        "settings": _by_key(options.settings) or None,
        "start_from": None if options.start is None else _start(options.start),
    }
    return {name: value for name, value in requested.items() if value is not None}


def _start(spec: str) -> Path:
    """Folder or file named by --from."""
    from footfall.policies.registry import ZOO, zoo_names

    return ZOO / spec if spec in zoo_names() else Path(spec)


def _by_key(settings: tuple[str, ...]) -> dict[str, Any]:
    """Values of the option --set, KEY=VALUE each, by key."""
    values = {}
    for setting in settings:
        key, equals, text = setting.partition("=")
        if not key or not equals:
            raise UserError(f"--set {setting}: expected KEY=VALUE, such as ppo.learning_rate=0.001")
        try:
            values[key] = parse_yaml(text)
        except ValueError as error:
            raise UserError(f"--set {setting}: {' '.join(str(error).split())}") from None
    return values


def _watched(folder: Path, page: PageOptions) -> AbstractContextManager[None]:
    from footfall.pages.beside import watched

    print(f"watch the training at {page.address}, afterwards with: footfall watch {folder}", flush=True)
    return watched(folder, page.host, page.port)


def _refuse_other_options(options: TrainOptions) -> None:
    defaults = TrainOptions()
    for field in fields(options):
        if field.name not in ALLOWED_WITH_RESUME and getattr(options, field.name) != getattr(
            defaults, field.name
        ):
            option = OPTION_NAMES.get(field.name, field.name.replace("_", "-"))
            raise UserError(f"--resume uses the run's own settings: leave --{option} out")
