"""The gait of a contract: phases from a named gait, reference lift from the robot's kinematics."""

import mujoco
import numpy as np

from footfall.envs.config import GaitConfig
from footfall.policies.contract import Gait
from footfall.policies.gaits import find_gait
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, training_model
from footfall.robots.robot_yaml import Foot
from footfall.robots.stance import in_default_pose


def make_gait(robot: Robot, config: GaitConfig) -> Gait:
    """Phases and reference amplitudes of each joint. Joints that move no foot stay still.

    Raises:
        UserError: there is no such gait for this robot.
    """
    amplitude = np.zeros(len(robot.joint_names))
    phase = np.zeros(len(robot.joint_names))
    pattern = find_gait(config.name, robot)
    for foot, joints, foot_phase in zip(
        robot.description.feet, robot.foot_joints, pattern.phase, strict=True
    ):
        phase[joints] = foot_phase
        if config.reference_lift_m > 0:
            amplitude[joints] = _lift(robot, foot, joints, config.reference_lift_m)
    return Gait(config.frequency_hz, tuple(phase.tolist()), tuple(amplitude.tolist()), pattern.duty)


def _lift(robot: Robot, foot: Foot, joints: np.ndarray, lift_m: float) -> np.ndarray:
    """Joint offsets from the default pose that raise a foot vertically, by damped Gauss-Newton.

    All of a sole's geoms are raised alike, so it stays level.
    """
    model = training_model(robot)
    data = in_default_pose(model, robot.description)
    positions, dofs = joint_addresses(model, robot)
    geoms = [model.geom(name).id for name in foot.geoms]
    goal = data.geom_xpos[geoms] + np.array([0.0, 0.0, lift_m])
    jacobian = np.zeros((len(geoms), 3, model.nv))
    for _ in range(50):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        for rows, geom in zip(jacobian, geoms, strict=True):
            mujoco.mj_jacGeom(model, data, rows, None, geom)
        leg = jacobian.reshape(-1, model.nv)[:, dofs[joints]]
        error = (goal - data.geom_xpos[geoms]).ravel()
        step = leg.T @ np.linalg.solve(leg @ leg.T + 1e-6 * np.eye(len(leg)), error)
        data.qpos[positions[joints]] += step
    return data.qpos[positions[joints]] - robot.default_pose[joints]
