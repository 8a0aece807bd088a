"""A trainer of a user's own, whose policy stands still: everything that `--trainer MODULE:NAME` needs."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from footfall.envs.make import make_environment
from footfall.policies.observation import observation_size
from footfall.robots.description import Robot
from footfall.train.actor import Actor
from footfall.train.export import export
from footfall.train.runs import checkpoint
from footfall.train.runs.folder import Run
from footfall.train.trainer import Trainer


class StandingTrainer(Trainer):
    """Counts its iterations. The zero action holds the default pose."""

    packages = ("tensordict",)

    def __init__(self, run: Run, robot: Robot) -> None:
        self.iteration = 0
        self._run = run
        self._contract = make_environment(robot, run.config.env).contract

    def restore(self, path: Path) -> None:
        self.iteration = int(path.read_text())

    def prepare(self, report: Callable[[str], None]) -> None:
        report("standing")

    def iterate(self) -> dict[str, float]:
        self.iteration += 1
        return {"reward/total": float(self.iteration)}

    def save(self) -> None:
        checkpoint.write(self._run.checkpoints, self.iteration, str(self.iteration).encode())

    def export(self, path: Path) -> float:
        size, actions = observation_size(self._contract), len(self._contract.joints)
        zeros = (np.zeros((size, actions), np.float32), np.zeros(actions, np.float32))
        mean, scale = np.zeros(size, np.float32), np.ones(size, np.float32)
        actor = Actor("standing", mean, scale, (zeros,), lambda seen: np.zeros((len(seen), actions)))
        return export(actor, self._contract, np.zeros((0, size)), path)


class Incomplete(Trainer):
    """A trainer without `save` and `export`."""

    def restore(self, path: Path) -> None: ...
    def prepare(self, report: Callable[[str], None]) -> None: ...
    def iterate(self) -> dict[str, float]:
        return {}


class Unrelated:
    """A class that is no trainer."""


NUMBER = 3
