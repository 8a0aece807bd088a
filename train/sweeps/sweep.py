"""Sweeps over settings and seeds on Ray Tune: each trial is an ordinary run."""

import logging
import math
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, NamedTuple

from rich.console import Console

from footfall.common.config import dump, load, merged, unstructure
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.common.installation import needs_extra
from footfall.robots.default import DEFAULT_ROBOT
from footfall.robots.description import Robot, load_robot
from footfall.train.api import TrainRequest, begin, resume
from footfall.train.config import TrainConfig, load_preset, train_config
from footfall.train.old_names import with_current_names
from footfall.train.runs.display import Display
from footfall.train.runs.journal import EPISODE_LENGTH
from footfall.train.sweeps.check import reported_metrics
from footfall.train.sweeps.results import (
    UNFINISHED,
    Point,
    Trial,
    last_value,
    points_of,
    points_table,
    trials_table,
)

DISTRIBUTIONS = (
    "choice", "grid_search", "uniform", "quniform", "loguniform", "qloguniform", "randint", "qrandint",
    "lograndint", "qlograndint", "randn", "qrandn",
)  # fmt: skip
OF_A_LIST = ("choice", "grid_search")  # take the list, the others its elements
STEPS = "environment_steps"  # what schedulers may count time in
SPEED = "speed/steps_per_s"
RAYS_OWN = ("training_iteration", "time_total_s", "time_this_iter_s")  # in every report, by Ray
DRAWS_SEED = 0  # a file's draws are the same each time
SETTINGS = "sweep.yaml"
RESULTS = "results.csv"  # one row for each trial
POINTS = "points.csv"  # one row for each point of the space, over its seeds
TUNE = "tune"  # Ray's own folder


@dataclass(frozen=True)
class SweepConfig:
    """What to sweep, as it stands in a sweep's YAML file."""

    space: dict[str, dict[str, list[Any]]]  # ppo.learning_rate: {loguniform: [1.0e-4, 1.0e-2]}
    robot: str = DEFAULT_ROBOT
    preset: str = "cpu"
    seeds: tuple[int, ...] = (0,)  # every point of the space is trained with each
    trials: int = 1  # draws from the space; lists under grid_search multiply them
    metric: str = "tracking/linear_error_m_s"
    mode: Literal["min", "max"] = "min"
    concurrent: int | None = None  # trials at once; as many as fit the machine by default
    cpus: float = 1.0  # for each trial
    gpus: float = 0.0  # for each trial; trials may share one
    # Name and settings as ray.tune.create_scheduler takes them.
    scheduler: dict[str, Any] = field(default_factory=lambda: {"name": "fifo"})

    def __post_init__(self) -> None:
        if not self.seeds:
            raise ValueError("seeds: the list is empty")
        if self.trials < 1:
            raise ValueError(f"trials must be at least 1, not {self.trials}")

    @property
    def points(self) -> int:
        """Trainings in the whole sweep."""
        grids = [
            len(declared["grid_search"]) for declared in self.space.values() if "grid_search" in declared
        ]
        return math.prod(grids) * len(self.seeds) * self.trials


class SweepResults(NamedTuple):
    """What has become of a sweep."""

    trials: list[Trial]  # those that began, the best first
    points: list[Point]  # trials of the same settings taken together, the best first
    unfinished: int  # trials that an interruption left to do, begun or not


def sweep(file: Path, out: Path) -> SweepResults:
    """Run a sweep into a new folder, until it ends or is interrupted.

    Raises:
        UserError: the file or a setting in it is wrong, ray is missing, or the folder is in use.
    """
    config = load(file, SweepConfig)
    tune = _tune()
    scheduler = _scheduler(tune, config)
    _try_one(tune, config)
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise UserError(f"{out} exists and is not empty: give another --out, or --resume {out}")
    try:
        out.mkdir(parents=True, exist_ok=True)
        write_atomically(out / SETTINGS, dump(config).encode())
    except OSError as error:
        raise UserError(f"cannot write to {out}: {error.strerror}") from None
    out = out.resolve()
    with _ray(config):
        tuner = tune.Tuner(
            _trainable(tune, config, out),
            param_space=_space(tune, config) | {"seed": tune.grid_search(list(config.seeds))},
            tune_config=tune.TuneConfig(
                metric=config.metric,
                mode=config.mode,
                scheduler=scheduler,
                search_alg=_search(config),
                num_samples=config.trials,
                trial_dirname_creator=lambda trial: trial.trial_id,
            ),
            run_config=tune.RunConfig(name=TUNE, storage_path=str(out), verbose=1),
        )
        return _results(tuner.fit(), config, out)


def resume_sweep(out: Path) -> SweepResults:
    """Continue a sweep that was interrupted; its unfinished trials go on from their checkpoints.

    Raises:
        UserError: ray is missing, or there is no sweep in this folder.
    """
    if not (out / SETTINGS).is_file():
        raise UserError(f"no sweep at {out}: expected a folder that 'footfall sweep' made")
    tune = _tune()
    out = out.resolve()
    config = load(out / SETTINGS, SweepConfig)
    if not tune.Tuner.can_restore(str(out / TUNE)):
        raise UserError(f"the sweep at {out} had not begun: start it again with another --out")
    with _ray(config):
        tuner = tune.Tuner.restore(str(out / TUNE), _trainable(tune, config, out))
        return _results(tuner.fit(), config, out)


def trial_config(preset: str, settings: dict[str, Any], robot: Robot) -> TrainConfig:
    """A robot's preset with some settings replaced, named by dotted keys.

    Raises:
        UserError: there is no such setting, or a value does not fit it.
    """
    data = unstructure(load_preset(preset, robot))
    changes: dict[str, Any] = {}
    for key, value in settings.items():
        *parents, name = key.split(".")
        there, changed = data, changes
        for parent in parents:
            there = there.get(parent) if isinstance(there, dict) else None
            changed = changed.setdefault(parent, {})
        if not isinstance(there, dict):
            raise UserError(f"no setting {key} in preset {preset}")
        changed[name] = value
    return train_config(merged(data, with_current_names(changes)), "sweep")


def _tune() -> ModuleType:
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # nothing is sent anywhere
    os.environ.setdefault("RAY_CHDIR_TO_TRIAL_DIR", "0")
    with needs_extra("sweep", "sweeps need"):
        from ray import tune
    return tune


@contextmanager
def _ray(config: SweepConfig) -> Iterator[None]:
    import ray

    environment = {}
    if 0.0 < config.gpus < 1.0:  # JAX would take three quarters of the memory for each of them
        environment["XLA_PYTHON_CLIENT_MEM_FRACTION"] = f"{0.9 * config.gpus:.3f}"
    ray.init(
        include_dashboard=False,
        log_to_driver=False,
        logging_level=logging.ERROR,
        runtime_env={"env_vars": environment},
    )
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGINT, before)  # Tune keeps its own where nothing interrupted it
        ray.shutdown()


def _search(config: SweepConfig) -> Any:
    """Draws from the space, the same ones each time, and each of them for every seed and grid value."""
    from ray.tune.search.basic_variant import BasicVariantGenerator

    return BasicVariantGenerator(
        max_concurrent=config.concurrent or 0, constant_grid_search=True, random_state=DRAWS_SEED
    )


def _space(tune: ModuleType, config: SweepConfig) -> dict[str, Any]:
    """Ray's search space.

    Raises:
        UserError: a distribution is unknown or its arguments are wrong.
    """
    space: dict[str, Any] = {}
    for key, declared in config.space.items():
        if len(declared) != 1 or next(iter(declared)) not in DISTRIBUTIONS:
            raise UserError(f"space.{key}: expected one of {', '.join(DISTRIBUTIONS)}")
        ((name, values),) = declared.items()
        if not values:
            raise UserError(f"space.{key}: {name}: the list is empty")
        try:
            space[key] = getattr(tune, name)(*([values] if name in OF_A_LIST else values))
            if name not in OF_A_LIST:
                space[key].sample(
                    random_state=DRAWS_SEED
                )  # bounds that leave nothing to draw are refused only here
        except (TypeError, ValueError, AssertionError, ArithmeticError) as error:
            raise UserError(f"space.{key}: {name}: {' '.join(str(error).split())}") from None
    return space


def _try_one(tune: ModuleType, config: SweepConfig) -> None:
    """Build one trial and trace its program, so that a mistake is known before anything runs.

    Raises:
        UserError: there is no such robot, setting, reward or metric, or a value does not fit.
    """
    drawn = {
        key: domain["grid_search"][0] if isinstance(domain, dict) else domain.sample(random_state=DRAWS_SEED)
        for key, domain in _space(tune, config).items()
    }
    robot = load_robot(config.robot)
    one = trial_config(config.preset, drawn, robot)
    for key, declared in config.space.items():
        for value in (value for name in OF_A_LIST for value in declared.get(name, ())):
            trial_config(config.preset, drawn | {key: value}, robot)
    known = [STEPS, SPEED, *reported_metrics(config.robot, one)]
    asked = {"metric": config.metric, "scheduler: time_attr": config.scheduler.get("time_attr")}
    for setting, name in asked.items():
        if name is not None and name not in (*known, *RAYS_OWN):
            raise UserError(f"{setting}: a trial reports no '{name}': there are {', '.join(known)}")


def _scheduler(tune: ModuleType, config: SweepConfig) -> Any:
    settings = dict(config.scheduler)
    name = settings.pop("name", None)
    try:
        return tune.create_scheduler(name, **settings)
    except (TypeError, ValueError, AssertionError, AttributeError) as error:
        raise UserError(f"scheduler: {' '.join(str(error).split())[:200]}") from None


def _trainable(tune: ModuleType, config: SweepConfig, out: Path) -> Any:
    def trial(settings: dict[str, Any]) -> None:
        _train(config, out / tune.get_context().get_trial_id(), dict(settings), tune.report)

    return tune.with_resources(trial, {"cpu": config.cpus, "gpu": config.gpus})


def _train(
    config: SweepConfig, folder: Path, settings: dict[str, Any], report: Callable[[dict], None]
) -> None:
    """One trial, in its own process: a new run, or one to go on with."""
    seed = settings.pop("seed")
    if not (folder / "run.yaml").exists():
        preset = folder.with_suffix(".yaml")
        trial = trial_config(config.preset, settings, load_robot(config.robot))
        write_atomically(preset, dump(trial).encode())
        begin(TrainRequest(robot=config.robot, preset=str(preset), seed=seed, out=folder))
    resume(folder, _Reporter(report))


class _Reporter(Display):
    """Tells Ray what a display would show."""

    def __init__(self, report: Callable[[dict], None]) -> None:
        super().__init__(0, Console(quiet=True))
        self._report = report

    def update(self, steps: int, steps_per_s: float, metrics: dict[str, float]) -> None:
        nothing_ended = {EPISODE_LENGTH: math.nan}  # Ray wants each metric in each report
        self._report({STEPS: steps, SPEED: steps_per_s, **nothing_ended, **metrics})


def _results(grid: Any, config: SweepConfig, out: Path) -> SweepResults:
    """The trials and points, best first, which are also written as comma-separated values."""
    trials = []
    for result in grid:
        metrics = result.metrics or {}
        settings = dict(result.config or {})
        folder = Path(result.path).name
        # Interrupted, Ray ends its trials as if they were through. Its reports tell those that a scheduler
        # stopped, and the policy those that reached their end: Ray may forget that of a trial resumed.
        through = bool(metrics.get("done")) or (out / folder / "policy.onnx").is_file()
        trials.append(
            Trial(
                folder=folder,
                seed=settings.pop("seed", -1),
                settings=settings,
                value=_value(metrics, config.metric, out / folder / "metrics.jsonl"),
                steps=metrics.get(STEPS, 0),
                error=_last_line(result.error) or ("" if through else UNFINISHED),
            )
        )
    sign = 1.0 if config.mode == "min" else -1.0
    trials.sort(key=lambda trial: (bool(trial.error), math.isnan(trial.value), sign * trial.value))
    points, names = points_of(trials, config.mode), list(config.space)
    write_atomically(out / RESULTS, trials_table(trials, names, config.metric).encode())
    write_atomically(out / POINTS, points_table(points, names, config.metric).encode())
    left = config.points - sum(trial.error != UNFINISHED for trial in trials)
    return SweepResults(trials, points, left)


def _value(last: dict[str, Any], metric: str, logged: Path) -> float:
    """A trial's result: a mean over its last iterations, or what Ray alone knows of it."""
    return float(last.get(metric, math.nan)) if metric in RAYS_OWN else last_value(logged, metric)


def _last_line(error: BaseException | None) -> str:
    lines = str(error or "").strip().splitlines()
    return lines[-1] if lines else ""
