"""The gait of a contract, derived from a robot: phases from its feet, reference lift from its kinematics."""

import mujoco
import numpy as np

from footfall.envs.config import GaitConfig
from footfall.policies.contract import Gait
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, training_model


def make_gait(robot: Robot, config: GaitConfig) -> Gait:
    """Phases and reference amplitudes of each joint. Joints of no foot stay still."""
    amplitude = np.zeros(len(robot.joint_names))
    phase = np.zeros(len(robot.joint_names))
    for foot, joints in zip(robot.description.feet, robot.foot_joints, strict=True):
        phase[joints] = foot.phase
        if config.reference_lift_m > 0:
            amplitude[joints] = _lift(robot, foot.geom, joints, config.reference_lift_m)
    return Gait(config.frequency_hz, tuple(phase.tolist()), tuple(amplitude.tolist()))


def _lift(robot: Robot, geom: str, joints: np.ndarray, lift_m: float) -> np.ndarray:
    """Joint offsets from the default pose that raise a foot straight up, by damped Gauss-Newton."""
    model = training_model(robot)
    data = mujoco.MjData(model)
    positions, dofs = joint_addresses(model, robot)
    data.qpos[:] = model.qpos0
    data.qpos[positions] = robot.default_pose
    mujoco.mj_kinematics(model, data)
    goal = data.geom(geom).xpos + np.array([0.0, 0.0, lift_m])
    jacobian = np.zeros((3, model.nv))
    for _ in range(50):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_jacGeom(model, data, jacobian, None, model.geom(geom).id)
        leg = jacobian[:, dofs[joints]]
        error = goal - data.geom(geom).xpos
        step = leg.T @ np.linalg.solve(leg @ leg.T + 1e-6 * np.eye(3), error)
        data.qpos[positions[joints]] += step
    return data.qpos[positions[joints]] - robot.default_pose[joints]
