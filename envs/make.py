"""The one place that makes an environment from a robot and a configuration."""

from typing import Any

from footfall.common.errors import UserError
from footfall.common.outside import find, is_import_path, one_line, sources
from footfall.envs.config import TERM_LISTS, EnvConfig
from footfall.envs.environment import Environment
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.workarounds.program_cache import model_bytes
from footfall.robots.description import Robot


def make_environment(robot: Robot, config: EnvConfig) -> Environment:
    """The environment of a configuration: its task's own, or the one that its terms describe.

    Raises:
        UserError: the configuration names something unknown, or does not fit the robot.
    """
    if not config.task:
        return LocomotionEnv(robot, config)
    if not is_import_path(config.task):
        raise UserError(f"env.task: '{config.task}' is no MODULE:NAME")
    make = find(config.task, "task")
    try:
        env = make(robot, config)
    except UserError:
        raise
    except Exception as error:  # any other error is the task's
        raise UserError(f"env.task: {config.task} cannot be made: {one_line(error)}") from error
    missing = [part for part in ("reset", "step", "contract", "observation_sizes") if not hasattr(env, part)]
    if missing:
        raise UserError(f"env.task: {config.task} makes no Environment: it has no {', '.join(missing)}")
    return env


def program_key(robot: Robot, config: EnvConfig) -> tuple[Any, ...]:
    """Cache key of compiled programs: all that they depend on, except footfall's source, libraries, devices.

    Two environments with an equal result have the same programs (envs/workarounds/program_cache.py).

    Raises:
        UserError: a module of the user's own cannot be imported.
    """
    return (
        robot.digest,
        model_bytes(robot, config.timestep_s, config.contacts),
        config,
        outside_sources(config),
    )


def outside_sources(config: EnvConfig) -> list[tuple[str, bytes]]:
    """The source of the user's own terms and task: names of modules, and the content of their files.

    Raises:
        UserError: a module cannot be imported.
    """
    listed = (entry.term for kind in ("observation", *TERM_LISTS) for entry in getattr(config, kind))
    names = {config.task, config.commands.term, *listed}
    return sources(sorted(filter(is_import_path, names)))
