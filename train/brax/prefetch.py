"""The compiled programs that an earlier training may have kept.

Imports neither brax nor flax, so that reading the programs begins while those are imported.
"""

from typing import Any

from footfall.envs.make import program_key as environment_key
from footfall.envs.workarounds.program_cache import prefetch
from footfall.robots.description import Robot
from footfall.train.config import TrainConfig

NAMES = ("act", "learn", "first state")


def prefetch_programs(robot: Robot, config: TrainConfig) -> None:
    """Start loading the compiled programs of an earlier training with this robot and settings."""
    key = program_key(robot, config)
    prefetch(*((name, *key) for name in NAMES))


def program_key(robot: Robot, config: TrainConfig) -> tuple[Any, ...]:
    """Cache key of a training's programs: all that they depend on, except source, libraries and devices."""
    return config.ppo, *environment_key(robot, config.env)
