"""Opens the physics engine of a simulated robot."""

from typing import get_args

import mujoco

from footfall.common.engines import DEFAULT_ENGINE, EngineName
from footfall.common.errors import UserError
from footfall.common.installation import needs_extra
from footfall.plant.engines.engine import Engine, MujocoEngine
from footfall.plant.engines.sloped_ground import SlopedGroundEngine
from footfall.terrain.ground import Ground


def open_engine(
    name: str, model: mujoco.MjModel, data: mujoco.MjData, feet: list[int], ground: Ground | None = None
) -> Engine:
    """The engine of this name for a plant.

    Args:
        name: one of `EngineName`.
        model: the bodies of the sampled robot.
        data: their state, which the engine reads and writes.
        feet: geoms of the feet.
        ground: the ground that is in the model; None: level ground, or the MJCF's own.

    Raises:
        UserError: there is no such engine, its extra is missing, or it does not simulate this model.
    """
    if name == DEFAULT_ENGINE:
        if ground is None or ground.stepped[0]:
            return MujocoEngine(model, data)
        return SlopedGroundEngine(model, data, ground)
    if name == "drake":
        with needs_extra("drake", "--engine drake needs"):
            from footfall.plant.engines.drake_engine import DrakeEngine

        return DrakeEngine(model, data, feet)
    if name == "motrixsim":
        with needs_extra("motrixsim", "--engine motrixsim needs"):
            from footfall.plant.engines.motrix_engine import MotrixEngine

        return MotrixEngine(model, data)
    raise UserError(f"no engine '{name}': there are {', '.join(get_args(EngineName))}")
