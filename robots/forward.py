"""Forward kinematics of a robot's limbs, by MuJoCo."""

from copy import copy
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.arrays import as_slice
from footfall.common.errors import UserError
from footfall.robots.limb import Limb
from footfall.robots.limb_order import LimbOrder
from footfall.robots.mjcf import load_spec
from footfall.robots.robot_yaml import Description


class LegPose(NamedTuple):
    """Pose of the limbs in the base frame."""

    foot: np.ndarray  # (legs, 3) m, tip of each limb: the middle of its foot's geoms
    jacobian: np.ndarray  # (legs, 3, m) m/rad, tip velocity = jacobian @ joint velocity
    axes: np.ndarray  # (legs, 3, m), column j is the direction of the limb's joint j


class ForwardKinematics:
    """The robot's own model with its base at the origin, and one pose at a time: not thread-safe."""

    def __init__(self, description: Description, xml_path: Path, order: LimbOrder) -> None:
        """Raises UserError if a limb has joints other than hinges."""
        spec = load_spec(xml_path)
        original = spec.compile()
        for foot in description.feet:
            geoms = [original.geom(name) for name in foot.geoms]
            tip = np.mean([geom.pos for geom in geoms], axis=0)
            spec.geom(foot.geoms[0]).parent.add_site(name=_tip_name(foot.name), pos=tip)
        self.model = model = spec.compile()
        self._data = mujoco.MjData(model)
        self._data.qpos[:] = 0.0
        for joint in range(model.njnt):
            if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
                self._data.qpos[model.jnt_qposadr[joint] + 3] = 1.0
        joints = np.array([model.joint(name).id for name in description.joint_names])
        self._addresses = as_slice(model.jnt_qposadr[joints])
        self._order = order
        self._hinges = joints[order.joints]  # (legs, m) ids in the model
        if np.any(model.jnt_type[self._hinges] != mujoco.mjtJoint.mjJNT_HINGE):
            raise UserError(f"{xml_path}: the joints of a leg must be hinges")
        self.tips = np.array([model.site(_tip_name(foot.name)).id for foot in description.feet])
        self._dofs = model.jnt_dofadr[self._hinges]
        self._bias = np.zeros(model.nv)
        self._full_jacobian = np.zeros((order.count, 3, model.nv))
        self._jacobian_of_tip = list(zip(self._full_jacobian, self.tips.tolist(), strict=True))
        # Indices of each limb's (3, m) in the flat arrays of all degrees of freedom, and of all axes.
        rows = np.arange(3 * order.count).reshape(order.count, 3, 1)
        self._jacobian_indices = rows * model.nv + self._dofs[:, None, :]
        self._axis_indices = 3 * self._hinges[:, None, :] + np.arange(3)[:, None]

    def twin(self) -> "ForwardKinematics":
        """A copy with its own pose."""
        twin = copy(self)
        twin._data = mujoco.MjData(self.model)
        twin._data.qpos[:] = self._data.qpos
        return twin

    @property
    def limits(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest angle of each hinge, rad, (legs, m); zero for missing hinges."""
        lower, upper = (self.model.jnt_range[self._hinges, side] * self._order.present for side in (0, 1))
        return lower, upper

    def pose(self, joint_position: np.ndarray) -> LegPose:
        """Feet, Jacobians and joint axes of joint positions (n,), rad."""
        model, data, order = self.model, self._data, self._order
        data.qpos[self._addresses] = joint_position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        foot = data.site_xpos.take(self.tips, axis=0)
        for full, tip in self._jacobian_of_tip:
            mujoco.mj_jacSite(model, data, full, None, tip)
        jacobian, axes = self._full_jacobian.take(self._jacobian_indices), data.xaxis.take(self._axis_indices)
        if order.uniform:
            return LegPose(foot, jacobian, axes)
        return LegPose(foot, jacobian * order.present[:, None], axes * order.present[:, None])

    def tip_rotation(self) -> np.ndarray:
        """Rotation of each limb's last link in the last pose, to the base frame, (legs, 3, 3)."""
        return self._data.site_xmat[self.tips].reshape(self._order.count, 3, 3)

    def holding_torque(self, acceleration: np.ndarray) -> np.ndarray:
        """Torques (legs, m), N m, that hold the limbs in the last pose: see `Legs.holding_torque`."""
        np.negative(acceleration, out=self.model.opt.gravity)
        mujoco.mj_rne(self.model, self._data, 0, self._bias)
        torque = self._bias.take(self._dofs)
        return torque if self._order.uniform else torque * self._order.present

    def limbs(self, default_pose: np.ndarray) -> list[Limb]:
        """Each limb as data, given the default pose (n,), rad."""
        data = self._data
        data.qpos[self._addresses] = 0.0
        mujoco.mj_kinematics(self.model, data)
        limbs = []
        for joints, hinges, tip in zip(self._order.joints_of, self._hinges, self.tips, strict=True):
            ids = hinges[: len(joints)]
            limbs.append(
                Limb(
                    anchor=data.xanchor[ids],
                    axis=data.xaxis[ids],
                    tip=data.site_xpos[tip].copy(),
                    lower=self.model.jnt_range[ids, 0],
                    upper=self.model.jnt_range[ids, 1],
                    default=default_pose[joints],
                )
            )
        return limbs


def _tip_name(foot: str) -> str:
    return f"footfall_tip_{foot}"
