"""Supports of a simulated robot: a compliant frame, or a stand."""

import mujoco

from footfall.plant.clamp import Clamp
from footfall.plant.hanging import Frame
from footfall.plant.sensors import Layout
from footfall.robots.description import Robot

Holder = Frame | Clamp


class Support:
    """Keeps a robot still until its motors are commanded, and in its frame or stand until it is released.

    Args:
        holder: the frame or stand; None if the robot stands by itself.
        steps: physics steps with commanded motors until the robot is released; infinite for never.
        still: whether the robot does not move until its motors are commanded.
    """

    def __init__(self, holder: Holder | None, steps: float, still: bool) -> None:
        self._holder, self._remaining_steps = holder, steps
        self.still = still

    def apply(self, commanded: bool) -> None:
        """Apply the holder's force in the next physics step, or release the robot.

        Args:
            commanded: whether the motors have been commanded.
        """
        self.still = self.still and not commanded
        if self._holder is None:
            return
        self._remaining_steps -= commanded
        if self._remaining_steps > 0:
            self._holder.apply()
        else:
            self._holder.release()
            self._holder = None


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
