"""Mapping of joints to limbs: from joint order to limbs and back."""

import numpy as np

from footfall.common.arrays import as_slice
from footfall.robots.robot_yaml import Description


class LimbOrder:
    """The limbs' joints, limb after limb. Arrays are as wide as the longest limb, m hinges."""

    def __init__(self, description: Description) -> None:
        self.joints_of = description.foot_joints  # of each limb, from the base outwards
        self.count = len(self.joints_of)
        self.hinges = max(map(len, self.joints_of))
        self.present = np.array([[k < len(limb) for k in range(self.hinges)] for limb in self.joints_of])
        self.uniform = bool(self.present.all())  # whether all limbs have the same number of hinges
        # A missing hinge gets the index of the limb's first one; `present` is False.
        self.joints = np.array([[*limb, *[limb[0]] * (self.hinges - len(limb))] for limb in self.joints_of])
        self._flat_joints = as_slice(self.joints.ravel())
        # Whether the robot's joints are exactly the limbs' joints, one limb after another.
        self._in_order = self.uniform and self._flat_joints == slice(0, len(description.joints), 1)

    def gather(self, joint_values: np.ndarray) -> np.ndarray:
        """Joint order (..., n) to limbs (..., legs, m); zero for missing hinges."""
        values = joint_values.take(self.joints, axis=-1)
        return values if self.uniform else values * self.present

    def scatter(self, leg_values: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Limbs (..., legs, m) to joint order (..., n); joints outside them keep their value in `others`."""
        if self._in_order:
            return leg_values.reshape(others.shape)
        result = others.copy()
        if self.uniform:
            result[..., self._flat_joints] = leg_values.reshape(*leg_values.shape[:-2], -1)
        else:
            result[..., self.joints[self.present]] = leg_values[..., self.present]
        return result
