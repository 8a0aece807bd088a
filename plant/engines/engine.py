"""The protocol of a physics engine, and its default implementation, MuJoCo.

With any engine the state is in MuJoCo's `MjData`, from which sensors, ground truth and films read it.
"""

from typing import Protocol

import mujoco
import numpy as np

DIVERGENCE_WARNINGS = [  # indices in `MjData.warning`
    int(kind)
    for kind in (
        mujoco.mjtWarning.mjWARN_BADQPOS,
        mujoco.mjtWarning.mjWARN_BADQVEL,
        mujoco.mjtWarning.mjWARN_BADQACC,
    )
]


class Engine(Protocol):
    """Moves the bodies of one plant."""

    def step(self) -> None:
        """Integrate one physics step under `qfrc_applied` and `xfrc_applied`, and update the state."""
        ...

    def touching(self) -> list[list[int]]:
        """The two geoms of each contact in the last step."""
        ...

    def normal_force(self, contact: int) -> float:
        """Normal force of a contact of `touching`, N."""
        ...

    def diverged(self) -> bool:
        """Whether the simulation diverged."""
        ...


class MujocoEngine:
    """MuJoCo C."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        self._warnings = data.warning.number
        self._wrench = np.zeros(6)

    def step(self) -> None:
        """See `Engine`."""
        mujoco.mj_step(self._model, self._data)

    def touching(self) -> list[list[int]]:
        """See `Engine`."""
        return self._data.contact.geom[: self._data.ncon].tolist()

    def normal_force(self, contact: int) -> float:
        """See `Engine`."""
        mujoco.mj_contactForce(self._model, self._data, contact, self._wrench)
        return float(self._wrench[0])

    def diverged(self) -> bool:
        """Whether MuJoCo has reset its state automatically after divergence."""
        return any(self._warnings[DIVERGENCE_WARNINGS].tolist())
