"""Inverse kinematics of a robot's limbs: joint angles for tip positions."""

from collections.abc import Sequence

import mujoco
import numpy as np

from footfall.robots.closed_form import closed_form
from footfall.robots.forward import ForwardKinematics
from footfall.robots.least_squares import Chains, LeastSquares
from footfall.robots.limb import Limb
from footfall.robots.limb_order import LimbOrder
from footfall.robots.robot_yaml import Description

_HINGES_FOR_LEVEL_SOLE = 6  # three for its position, three for its orientation


class InverseKinematics:
    """Inverse kinematics in closed form for limbs that have one, by damped least squares for all others."""

    def __init__(
        self,
        description: Description,
        limbs: list[Limb],
        default_foot: np.ndarray,
        order: LimbOrder,
        forward: ForwardKinematics,
    ) -> None:
        """`default_foot` (legs, 3), m, has the tip positions in the default pose, base frame."""
        self._form_of = [closed_form(limb, tip) for limb, tip in zip(limbs, default_foot, strict=True)]
        self._forms = [form for form in self._form_of if form is not None]
        self._count, self._hinges = order.count, order.hinges
        all_closed = len(self._forms) == order.count
        self._chains = None if all_closed else least_squares(description, order, forward)

    @property
    def closed(self) -> list[bool]:
        """Whether each limb has a closed form."""
        return [form is not None for form in self._form_of]

    def solve(self, foot: np.ndarray, legs: Sequence[int] | None = None) -> np.ndarray:
        """Joint angles (k, m), rad, for tip positions (k, 3), m: see `Legs.solve`."""
        if self._chains is None:
            chosen = self._forms if legs is None else [self._forms[leg] for leg in legs]
            # Limb by limb: for so few numbers, Python floats take a quarter of NumPy's time.
            return np.array([form.angles(tip) for tip, form in zip(foot.tolist(), chosen, strict=True)])
        chosen_legs = list(range(self._count)) if legs is None else list(legs)
        angles = np.zeros((len(chosen_legs), self._hinges))
        others = [row for row, leg in enumerate(chosen_legs) if self._form_of[leg] is None]
        for row, leg in enumerate(chosen_legs):
            form = self._form_of[leg]
            if form is not None:
                angles[row, :3] = form.angles(foot[row].tolist())
        if others:
            angles[others] = self._chains.solve(foot[others], [chosen_legs[row] for row in others])
        return angles


def least_squares(description: Description, order: LimbOrder, forward: ForwardKinematics) -> LeastSquares:
    """Solves for the angles of any limbs, from the default pose."""
    soles = np.array([_is_sole(forward.model, foot.geoms) for foot in description.feet])
    can_be_level = order.present.sum(axis=1) >= _HINGES_FOR_LEVEL_SOLE
    twin, default = forward.twin(), description.default_pose  # a twin: the cached last pose stays valid

    def chains(angles: np.ndarray) -> Chains:
        return Chains(*twin.pose(order.scatter(angles, default)), twin.tip_rotation())

    return LeastSquares(chains, *forward.limits, order.gather(default), soles & can_be_level)


def _is_sole(model: mujoco.MjModel, geoms: Sequence[str]) -> bool:
    """Whether a foot is anything but a single sphere."""
    return len(geoms) > 1 or model.geom(geoms[0]).type[0] != mujoco.mjtGeom.mjGEOM_SPHERE
