"""The compiled programs that an earlier training may have kept.

Imports neither brax nor flax, so that reading the programs begins while those are imported.
"""

from typing import Any

from footfall.envs.make import made_from as environment_made_from
from footfall.envs.workarounds.program_cache import prefetch
from footfall.robots.description import Robot
from footfall.train.config import TrainConfig

NAMES = ("act", "learn", "first state")


def prefetch_programs(robot: Robot, config: TrainConfig) -> None:
    """Start loading the compiled programs of an earlier training with this robot and settings."""
    parts = made_from(robot, config)
    prefetch(*((name, *parts) for name in NAMES))


def made_from(robot: Robot, config: TrainConfig) -> tuple[Any, ...]:
    """Everything that a training's programs depend on, except source, libraries and devices."""
    return config.ppo, *environment_made_from(robot, config.env)
