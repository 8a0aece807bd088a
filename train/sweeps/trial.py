"""One trial of a sweep: an ordinary run, in a process of its own."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console

from footfall.common.config import dump
from footfall.common.files import write_atomically
from footfall.robots.description import load_robot
from footfall.train.api import TrainRequest, begin, resume
from footfall.train.runs.display import Display
from footfall.train.runs.pending import EPISODE_LENGTH
from footfall.train.sweeps.config import SweepConfig, trial_config

STEPS = "environment_steps"  # a time_attr of schedulers
SPEED = "speed/steps_per_s"
RAY_METRICS = ("training_iteration", "time_total_s", "time_this_iter_s")  # added by Ray to every report


def train_trial(
    config: SweepConfig, folder: Path, settings: dict[str, Any], report: Callable[[dict], None]
) -> None:
    """Train a new run, or continue one.

    Args:
        config: settings of the sweep.
        folder: the trial's run folder.
        settings: settings of the trial by dotted keys, and its "seed".
        report: takes each iteration's metrics.
    """
    seed = settings.pop("seed")
    if not (folder / "run.yaml").exists():
        preset = folder.with_suffix(".yaml")
        trial = trial_config(config.preset, settings, load_robot(config.robot))
        write_atomically(preset, dump(trial).encode())
        begin(
            TrainRequest(
                robot=config.robot, preset=str(preset), seed=seed, out=folder, trainer=config.trainer
            )
        )
    resume(folder, Reporter(report))


class Reporter(Display):
    """A display that reports metrics to Ray."""

    def __init__(self, report: Callable[[dict], None]) -> None:
        super().__init__(0, Console(quiet=True))
        self._report = report

    def update(self, steps: int, steps_per_s: float, metrics: dict[str, float]) -> None:
        no_length = {EPISODE_LENGTH: math.nan}  # Ray needs each metric in each report
        self._report({STEPS: steps, SPEED: steps_per_s, **no_length, **metrics})
