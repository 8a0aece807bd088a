"""Checks that the physics supports a configuration."""

import mujoco

from footfall.common.errors import UserError
from footfall.envs.config import EnvConfig
from footfall.envs.physics.engines import Engine
from footfall.envs.task import Task
from footfall.robots.description import Robot
from footfall.robots.stability import longest_timestep


def check_events(task: Task, engine: Engine) -> None:
    """Raise UserError if an event needs the generated physics and another engine runs."""
    for name, event in task.events.items():
        if event.generated_only and engine.name != "generated":
            message = f"env.events: '{name}' needs physics 'generated', not '{engine.name}'. {engine.note}"
            raise UserError(message.strip())


def check_timestep(robot: Robot, model: mujoco.MjModel, config: EnvConfig) -> None:
    """Raise UserError if the physics steps are too long for the robot's joints."""
    longest_s, joint = longest_timestep(robot.description, model, robot.kp)
    if config.timestep_s > longest_s:
        raise UserError(
            f"control_rate_hz {config.control_rate_hz:g} with {config.substeps} substeps makes steps of"
            f" {1e3 * config.timestep_s:.3g} ms: joint {joint} of {robot.name} is too stiff for steps beyond"
            f" {1e3 * longest_s:.3g} ms"
        )
