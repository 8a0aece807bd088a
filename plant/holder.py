"""Supports of a simulated robot: a compliant frame, or a stand."""

import mujoco

from footfall.plant.clamp import Clamp
from footfall.plant.hanging import Frame
from footfall.plant.sensors import Layout
from footfall.robots.description import Robot

Holder = Frame | Clamp


def holder(
    robot: Robot,
    model: mujoco.MjModel,
    data: mujoco.MjData,
    layout: Layout,
    base: int,
    hanging: bool,
    clamped: bool,
    raised_m: float,
) -> Holder | None:
    """The robot's support, which raises it by `raised_m`; None if it stands by itself."""
    height_m = robot.description.standing_height_m
    if hanging or clamped:
        data.qpos[layout.base_qpos + 2] += raised_m
        mujoco.mj_forward(model, data)
    elif not robot.description.held_start:
        return None
    mass_kg = float(model.body_subtreemass[base])
    if clamped:
        return Clamp(model, data, layout, mass_kg)
    return Frame(data, layout, base, mass_kg, height_m)
