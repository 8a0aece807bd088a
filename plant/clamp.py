"""A stand to which the base is bolted, so that motions of the legs do not move it."""

import mujoco

from footfall.plant.sensors import Layout

BASE_SHARE = 1e6  # inertia added to the base, over the robot's mass: the legs cannot move it measurably


class Clamp:
    """Adds a very large inertia to the base, and sets the base's speed to zero at each step."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, layout: Layout, mass_kg: float) -> None:
        """Hold the base at its pose in `data`."""
        self._model, self._data = model, data
        self._dofs = slice(layout.base_qvel, layout.base_qvel + 6)
        model.dof_armature[self._dofs] += BASE_SHARE * mass_kg

    def apply(self) -> None:
        """Set the base's speed to zero before the next physics step."""
        self._data.qvel[self._dofs] = 0.0

    def release(self) -> None:
        """Restore the base's own inertia."""
        self._model.dof_armature[self._dofs] = 0.0
