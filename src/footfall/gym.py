"""Gymnasium environments; importing this module registers them.

    gymnasium.make("footfall.gym:footfall/Go1Velocity-v0")

imports it automatically. There is one environment for each shipped robot.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import gymnasium

from footfall.robots.description import available_robots, load_robot
from footfall.train.config import load_preset

if TYPE_CHECKING:
    from footfall.envs.gymnasium_env import GymnasiumEnv, GymnasiumVectorEnv


def make_single(
    robot: str | Path,
    preset: str = "cpu",
    physics: Literal["generated", "mjx", "c"] = "generated",
    render_mode: str | None = None,
) -> "GymnasiumEnv":
    """A single environment.

    Args:
        robot: name of a robot, or a folder with robot.yaml.
        preset: training preset, by name or file; its `env` section is used.
        physics: replaces the preset's physics.
        render_mode: "rgb_array" or None.

    Raises:
        UserError: there is no such robot, preset or render mode.
    """
    from footfall.envs.gymnasium_env import GymnasiumEnv

    description = load_robot(robot)
    config = replace(load_preset(preset, description).env, physics=physics)
    return GymnasiumEnv(description, config, render_mode)


def make_vector(
    robot: str | Path,
    num_envs: int = 1,
    preset: str = "cpu",
    physics: Literal["generated", "mjx", "c"] = "generated",
    render_mode: str | None = None,
) -> "GymnasiumVectorEnv":
    """A vector environment; other arguments as in `make_single`."""
    from footfall.envs.gymnasium_env import GymnasiumVectorEnv

    description = load_robot(robot)
    config = replace(load_preset(preset, description).env, physics=physics)
    return GymnasiumVectorEnv(description, config, num_envs, render_mode)


for _name in available_robots():
    gymnasium.register(
        id=f"footfall/{''.join(part.capitalize() for part in _name.split('_'))}Velocity-v0",
        entry_point=f"{__name__}:make_single",
        vector_entry_point=f"{__name__}:make_vector",
        kwargs={"robot": _name},
    )
