"""A robot as a single rigid body, and its legs' own inertia: what model-based controllers believe."""

from dataclasses import dataclass

import mujoco
import numpy as np

from footfall.robots.description import Robot, load_spec


@dataclass(frozen=True)
class RigidBody:
    """A robot frozen in its default pose, base frame."""

    mass: float  # kg
    centre: np.ndarray  # (3,) m, centre of mass from the base's origin
    inertia: np.ndarray  # (3, 3) kg m^2 about the centre of mass
    leg_inertia: np.ndarray  # (legs, 3, 3) kg m^2, joint space, reflected inertia included


def nominal_body(robot: Robot) -> RigidBody:
    """The composite body of the robot's own model; a plant's true masses are never looked at."""
    model = load_spec(robot.xml_path).compile()
    data = mujoco.MjData(model)
    joints = [model.joint(name).id for name in robot.joint_names]
    data.qpos[:] = 0.0
    for joint in range(model.njnt):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[model.jnt_qposadr[joint] + 3] = 1.0
    data.qpos[model.jnt_qposadr[joints]] = robot.default_pose
    mujoco.mj_forward(model, data)

    base = model.body(robot.description.base).id
    rotation = data.xmat[base].reshape(3, 3)
    masses = model.body_mass
    centre = data.subtree_com[base]
    inertia = np.zeros((3, 3))
    for body in range(1, model.nbody):
        turn = data.ximat[body].reshape(3, 3)
        arm = data.xipos[body] - centre
        inertia += turn @ np.diag(model.body_inertia[body]) @ turn.T
        inertia += masses[body] * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))

    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    dofs = model.jnt_dofadr[joints][robot.foot_joints]
    return RigidBody(
        mass=float(masses.sum()),
        centre=rotation.T @ (centre - data.xpos[base]),
        inertia=rotation.T @ inertia @ rotation,
        leg_inertia=full[dofs[:, :, None], dofs[:, None, :]],
    )
