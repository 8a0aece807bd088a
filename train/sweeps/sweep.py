"""Sweeps over settings and seeds on Ray Tune."""

import logging
import math
import os
import signal
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from footfall.common.config import dump, load
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.common.installation import needs_extra
from footfall.robots.description import load_robot
from footfall.train.sweeps.config import SweepConfig, trial_config
from footfall.train.sweeps.metric_names import reported_metrics
from footfall.train.sweeps.results import (
    UNFINISHED,
    Point,
    Trial,
    last_value,
    points_of,
    points_table,
    trials_table,
)
from footfall.train.sweeps.space import (
    TAKES_LIST,
    first_draw,
    make_scheduler,
    search_algorithm,
    search_space,
)
from footfall.train.sweeps.trial import RAY_METRICS, SPEED, STEPS, train_trial

SETTINGS = "sweep.yaml"
RESULTS = "results.csv"  # one row for each trial
POINTS = "points.csv"  # one row for each point of the space, over its seeds
ENDING = (signal.SIGTERM, signal.SIGHUP)  # signals that end a sweep as Ctrl-C does
TUNE = "tune"  # Ray's own folder


class SweepResults(NamedTuple):
    """The results of a sweep."""

    trials: list[Trial]  # those that were started, the best first
    points: list[Point]  # trials grouped by settings, the best first
    unfinished: int  # trials not run or not finished because of an interruption


def sweep(file: Path, out: Path) -> SweepResults:
    """Run a sweep into a new folder, until it ends or is interrupted.

    Raises:
        UserError: the file or a setting in it is wrong, ray is missing, or the folder is in use.
    """
    config = load(file, SweepConfig)
    tune = import_tune()
    scheduler = make_scheduler(tune, config)
    _check_first_trial(tune, config)
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
            param_space=search_space(tune, config) | {"seed": tune.grid_search(list(config.seeds))},
            tune_config=tune.TuneConfig(
                metric=config.metric,
                mode=config.mode,
                scheduler=scheduler,
                search_alg=search_algorithm(config),
                num_samples=config.trials,
                trial_dirname_creator=lambda trial: trial.trial_id,
            ),
            run_config=tune.RunConfig(name=TUNE, storage_path=str(out), verbose=1),
        )
        return collect_results(tuner.fit(), config, out)


def resume_sweep(out: Path) -> SweepResults:
    """Continue a sweep that was interrupted; its unfinished trials go on from their checkpoints.

    Raises:
        UserError: ray is missing, or there is no sweep in this folder.
    """
    if not (out / SETTINGS).is_file():
        raise UserError(f"no sweep at {out}: expected a folder that 'footfall sweep' made")
    tune = import_tune()
    out = out.resolve()
    config = load(out / SETTINGS, SweepConfig)
    if not tune.Tuner.can_restore(str(out / TUNE)):
        raise UserError(f"the sweep at {out} never started: start a new one with another --out")
    with _ray(config):
        tuner = tune.Tuner.restore(str(out / TUNE), _trainable(tune, config, out))
        return collect_results(tuner.fit(), config, out)


def import_tune() -> ModuleType:
    """Ray Tune.

    Raises:
        UserError: it is not installed.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # no usage statistics are sent
    os.environ.setdefault("RAY_CHDIR_TO_TRIAL_DIR", "0")
    with needs_extra("sweep", "sweeps need"):
        from ray import tune
    return tune


@contextmanager
def _ray(config: SweepConfig) -> Iterator[None]:
    import ray

    main = threading.current_thread() is threading.main_thread()
    previous = {number: signal.getsignal(number) for number in (signal.SIGINT, *ENDING)}
    environment = {}
    if 0.0 < config.gpus < 1.0:  # each trial's JAX would take three quarters of the memory
        environment["XLA_PYTHON_CLIENT_MEM_FRACTION"] = f"{0.9 * config.gpus:.3f}"
    try:
        ray.init(
            include_dashboard=False,
            log_to_driver=False,
            logging_level=logging.ERROR,
            runtime_env={"env_vars": environment},
        )
    except SystemExit:  # of Ray's own handler of SIGTERM, while it starts
        raise KeyboardInterrupt from None
    if main:
        _end_like_ctrl_c(number for number in ENDING if previous[number] != signal.SIG_IGN)
    try:
        yield
    finally:
        if main:
            for number, handler in previous.items():
                signal.signal(number, handler)  # Tune leaves its own handler unless it was interrupted
        ray.shutdown()


def _end_like_ctrl_c(numbers: Iterable[int]) -> None:
    """Let signals end a sweep as Ctrl-C does. Ray's own handler of SIGTERM would abort the process."""
    handled = list(numbers)

    def interrupt(*_: object) -> None:
        for number in handled:  # `timeout` and a closing terminal send two signals
            signal.signal(number, signal.SIG_IGN)
        signal.raise_signal(signal.SIGINT)

    for number in handled:
        signal.signal(number, interrupt)


def _check_first_trial(tune: ModuleType, config: SweepConfig) -> None:
    """Check the settings of a first trial and the metrics that it reports, before anything runs.

    Raises:
        UserError: there is no such robot, setting, reward or metric, or a value does not fit.
    """
    drawn = first_draw(search_space(tune, config))
    robot = load_robot(config.robot)
    first_trial = trial_config(config.preset, drawn, robot)
    for key, declared in config.space.items():
        for value in (value for name in TAKES_LIST for value in declared.get(name, ())):
            trial_config(config.preset, drawn | {key: value}, robot)
    reported = reported_metrics(config.robot, first_trial, config.trainer)
    if reported is None:
        return
    known = [STEPS, SPEED, *reported]
    configured = {"metric": config.metric, "scheduler: time_attr": config.scheduler.get("time_attr")}
    for setting, name in configured.items():
        if name is not None and name not in (*known, *RAY_METRICS):
            raise UserError(f"{setting}: a trial reports no '{name}': there are {', '.join(known)}")


def _trainable(tune: ModuleType, config: SweepConfig, out: Path) -> Any:
    def trial(settings: dict[str, Any]) -> None:
        train_trial(config, out / tune.get_context().get_trial_id(), dict(settings), tune.report)

    return tune.with_resources(trial, {"cpu": config.cpus, "gpu": config.gpus})


def collect_results(grid: Any, config: SweepConfig, out: Path) -> SweepResults:
    """The trials and points, best first; writes them as comma-separated values."""
    trials = []
    for result in grid:
        metrics = result.metrics or {}
        settings = dict(result.config or {})
        folder = Path(result.path).name
        # After an interruption Ray reports all trials as ended. "done" marks the trials that a scheduler
        # stopped. The policy file marks finished trials: Ray may forget "done" of a resumed trial.
        has_ended = bool(metrics.get("done")) or (out / folder / "policy.onnx").is_file()
        trials.append(
            Trial(
                folder=folder,
                seed=settings.pop("seed", -1),
                settings=settings,
                value=_value(metrics, config.metric, out / folder / "metrics.jsonl"),
                steps=metrics.get(STEPS, 0),
                error=_last_line(result.error) or ("" if has_ended else UNFINISHED),
            )
        )
    sign = 1.0 if config.mode == "min" else -1.0
    trials.sort(key=lambda trial: (bool(trial.error), math.isnan(trial.value), sign * trial.value))
    points, names = points_of(trials, config.mode), list(config.space)
    write_atomically(out / RESULTS, trials_table(trials, names, config.metric).encode())
    write_atomically(out / POINTS, points_table(points, names, config.metric).encode())
    unfinished = config.trainings - sum(trial.error != UNFINISHED for trial in trials)
    return SweepResults(trials, points, unfinished)


def _value(last: dict[str, Any], metric: str, logged: Path) -> float:
    """A trial's result: a mean over its last iterations, or a metric of Ray's own."""
    return float(last.get(metric, math.nan)) if metric in RAY_METRICS else last_value(logged, metric)


def _last_line(error: BaseException | None) -> str:
    lines = str(error or "").strip().splitlines()
    return lines[-1] if lines else ""
