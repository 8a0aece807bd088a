"""The engines by name, and the fallback if the configured one is not available."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import mujoco

from footfall.envs.physics.c import c_physics
from footfall.envs.physics.generated.physics import generated_physics, not_generated
from footfall.envs.physics.interface import Physics
from footfall.robots.description import Robot


def _mjx_physics(model: mujoco.MjModel, robot: Robot) -> Physics:
    from footfall.envs.physics.mjx import mjx_physics  # imports MJX, which takes a second and few need

    return mjx_physics(model, robot)


ENGINES: dict[str, Callable[[mujoco.MjModel, Robot], Physics]] = {
    "generated": generated_physics,
    "mjx": _mjx_physics,
    "c": c_physics,
}


class Engine(NamedTuple):
    """An engine made for one robot."""

    name: str  # in `ENGINES`
    simulate: Physics
    note: str = ""  # why it is not the configured engine

    @property
    def on_host(self) -> bool:
        """Whether it runs on the host's CPU, where branches of a program cost little."""
        return self.name == "c" or (self.name == "generated" and jax.default_backend() == "cpu")


def _not_generated(model: mujoco.MjModel, robot: Robot) -> str:
    """Why the generated physics does not serve here; empty if it does."""
    if robot.actuator_net is not None:
        return "the generated physics does not support actuator_net"
    return not_generated(model)


def make_engine(name: str, model: mujoco.MjModel, robot: Robot) -> Engine:
    """The engine of this name, or the next best one for a model that cannot be generated.

    Args:
        name: one of `ENGINES`.
        model: the robot's training model, nominal.
        robot: the robot.
    """
    reason = _not_generated(model, robot) if name == "generated" else ""
    if not reason:
        return Engine(name, ENGINES[name](model, robot))
    fallback = "c" if jax.default_backend() == "cpu" else "mjx"
    note = f"{robot.name} is trained with physics '{fallback}' instead: {reason}"
    return Engine(fallback, ENGINES[fallback](model, robot), note)
