"""A robot as a single rigid body, and the inertia of its legs, for model-based controllers."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from footfall.common.rotations import skew
from footfall.robots.description import Robot
from footfall.robots.mjcf import load_spec
from footfall.robots.stance import in_default_pose


@dataclass(frozen=True)
class RigidBody:
    """A robot frozen in its default pose, base frame."""

    mass: float  # kg
    centre: np.ndarray  # (3,) m, centre of mass from the base's origin
    inertia: np.ndarray  # (3, 3) kg m^2 about the centre of mass
    leg_inertia: np.ndarray  # (legs, m, m) kg m^2, joint space as in `Legs`, reflected inertia included
    # (legs, 3, m) kg m^2: angular momentum about the centre of mass per joint rate, base frame
    leg_momentum: np.ndarray

    @cached_property
    def inverse_inertia(self) -> np.ndarray:
        """Inverse of the inertia, (3, 3)."""
        return np.linalg.inv(self.inertia)


def nominal_body(robot: Robot) -> RigidBody:
    """The composite body of the robot's own model; the plant's true masses are not used."""
    model = load_spec(robot.xml_path).compile()
    data, inertia = in_default_pose(model, robot.description), np.zeros((model.nv, model.nv))
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fullM(model, data, inertia)
    base = model.body(robot.description.base)
    base_dofs = np.arange(6) + base.dofadr[0]
    legs = robot.legs
    joints = np.array([model.joint(name).dofadr[0] for name in robot.joint_names])[legs.joints]
    present = legs.present[:, :, None] & legs.present[:, None, :]
    mass = model.body_subtreemass[base.id]
    centre = data.subtree_com[base.id]
    arm = skew(centre)
    coupling = inertia[base_dofs][:, joints].transpose(1, 0, 2) * legs.present[:, None]  # base and joints
    return RigidBody(
        mass=float(mass),
        centre=centre,
        inertia=inertia[np.ix_(base_dofs[3:], base_dofs[3:])] + mass * arm @ arm,  # parallel axis theorem
        leg_inertia=inertia[joints[:, :, None], joints[:, None, :]] * present,
        leg_momentum=coupling[:, 3:] - arm @ coupling[:, :3],
    )
