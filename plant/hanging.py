"""A frame that holds a simulated robot: stiff springs between its base and its initial pose."""

import mujoco
import numpy as np

from footfall.plant.sensors import Layout

FREQUENCY_RAD_S = 60.0  # of the robot in the frame
GYRATION_SHARE = 0.5  # radius of gyration over the base's height


class Frame:
    """Critically damped springs on the base."""

    def __init__(
        self, data: mujoco.MjData, layout: Layout, base: int, mass_kg: float, height_m: float
    ) -> None:
        """Hold the robot at its pose in `data`; `base` is the base body, `height_m` its height."""
        at = layout.base_qpos
        self._data, self._base, self._at, self._dof = data, base, at, layout.base_qvel
        self._position, self._quaternion = data.qpos[at : at + 3].copy(), data.qpos[at + 3 : at + 7].copy()
        inertia = mass_kg * (GYRATION_SHARE * height_m) ** 2
        self._stiffness = FREQUENCY_RAD_S**2 * np.array([mass_kg, inertia])
        self._damping = 2.0 * FREQUENCY_RAD_S * np.array([mass_kg, inertia])

    def apply(self) -> None:
        """Apply the frame's force and torque for the next physics step."""
        data, at, dof = self._data, self._at, self._dof
        rotation_error = np.zeros(3)
        mujoco.mju_subQuat(rotation_error, self._quaternion, data.qpos[at + 3 : at + 7])  # base frame
        rotation = data.xmat[self._base].reshape(3, 3)
        (k, k_turn), (d, d_turn) = self._stiffness, self._damping
        force = k * (self._position - data.qpos[at : at + 3]) - d * data.qvel[dof : dof + 3]
        torque = rotation @ (k_turn * rotation_error - d_turn * data.qvel[dof + 3 : dof + 6])
        data.xfrc_applied[self._base] = [*force, *torque]

    def release(self) -> None:
        """Remove the frame's force and torque."""
        self._data.xfrc_applied[self._base] = 0.0
