"""A stand that the base is bolted to: the base does not move, whatever the legs do."""

import mujoco

from footfall.plant.sensors import Layout

BASE_SHARE = 1e6  # inertia added to the base, over the robot's mass: legs move it by nothing measurable


class Clamp:
    """An inertia so large that forces do not move the base, and a speed that is taken away each step."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, layout: Layout, mass_kg: float) -> None:
        """Hold the base at its pose in `data`."""
        self._model, self._data = model, data
        self._dofs = slice(layout.base_qvel, layout.base_qvel + 6)
        model.dof_armature[self._dofs] += BASE_SHARE * mass_kg

    def pull(self) -> None:
        """Take the base's speed away before the next physics step."""
        self._data.qvel[self._dofs] = 0.0

    def let_go(self) -> None:
        """Give the base its own inertia back."""
        self._model.dof_armature[self._dofs] = 0.0
