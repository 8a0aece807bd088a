"""The one place that makes an environment from a robot and a configuration."""

from typing import Any

from footfall.envs.config import EnvConfig
from footfall.envs.environment import Environment
from footfall.envs.velocity import VelocityEnv
from footfall.envs.workarounds.program_cache import model_bytes
from footfall.robots.description import Robot


def make_environment(robot: Robot, config: EnvConfig) -> Environment:
    """The environment of a configuration.

    Raises:
        UserError: the configuration names something unknown, or does not fit the robot.
    """
    return VelocityEnv(robot, config)


def made_from(robot: Robot, config: EnvConfig) -> tuple[Any, ...]:
    """Everything that a compiled program of the environment depends on, but source, libraries and devices.

    Two environments with an equal result have the same programs (envs/workarounds/program_cache.py).
    """
    return robot.digest, model_bytes(robot, config.timestep_s), config
