"""Limits of stiffness and damping for stable physics steps."""

from collections.abc import Iterator

import mujoco
import numpy as np

from footfall.robots.actuator import Motor
from footfall.robots.robot_yaml import Description
from footfall.robots.stance import in_default_pose

TRAINING_TIMESTEP_S = 0.005
PLANT_TIMESTEP_S = 0.001
# Share of a velocity that an explicit step may remove; above 2, speeds grow without bound.
MAX_VELOCITY_SHARE = 1.5
MAX_STEP_ANGLE_RAD = 2.0  # natural frequency times step; above, oscillations grow (symplectic Euler)


def instabilities(
    description: Description, model: mujoco.MjModel, kp: np.ndarray, kd: np.ndarray, motor: Motor
) -> Iterator[str]:
    """Joints with too much stiffness or damping for their inertia, in the default pose, with a free base.

    The plant's steps are explicit in the damping: a step of length h removes h D / M of a velocity. Training
    steps are implicit in it (envs/physics/interface.py) but longer. The stiffness is explicit in both.

    Args:
        description: description of the robot.
        model: its compiled MJCF.
        kp: stiffness, N m/rad, (n,).
        kd: damping, N m s/rad, (n,).
        motor: the joints' friction and damping.
    """
    longest_s, joint = longest_timestep(description, model, kp)
    if longest_s < TRAINING_TIMESTEP_S:
        yield (
            f"gains: natural_frequency_hz of {description.gains.natural_frequency_hz:g} makes joint"
            f" {joint} too stiff for physics steps of {1e3 * TRAINING_TIMESTEP_S:g} ms"
        )
    dry = motor.friction + (0.0 if motor.stribeck is None else motor.stribeck)
    damping = kd + dry / motor.friction_speed + motor.damping
    rate, index = _fastest(_mobility(description, model), damping)
    if PLANT_TIMESTEP_S * rate > MAX_VELOCITY_SHARE:
        yield (
            f"joint {description.joint_names[index]}: kd, friction at low speed and damping come to"
            f" {damping[index]:.3g} N m s/rad, too much for its inertia and physics steps of"
            f" {1e3 * PLANT_TIMESTEP_S:g} ms"
        )


def longest_timestep(description: Description, model: mujoco.MjModel, kp: np.ndarray) -> tuple[float, str]:
    """The longest stable time step of this robot, s, and the stiffest joint.

    A spring of natural frequency w is stable for w h < 2. The same holds with the training's damping: of
    (M + h/2 D) (v' - v) = -h (K q + D v), q' = q + h v' the roots leave the unit circle at -1, where
    h^2 K = 4 M.

    Args:
        description: description of the robot.
        model: its compiled MJCF, or a model that it is trained on.
        kp: stiffness, N m/rad, (n,).
    """
    squared_frequency, joint = _fastest(_mobility(description, model), kp)
    return float(MAX_STEP_ANGLE_RAD / np.sqrt(squared_frequency)), description.joint_names[joint]


def _mobility(description: Description, model: mujoco.MjModel) -> np.ndarray:
    """Acceleration of each joint per torque on each joint, (n, n): the inverse of the joint-space inertia."""
    data, mass = in_default_pose(model, description), np.zeros((model.nv, model.nv))
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fullM(model, data, mass)
    dofs = [model.joint(name).dofadr[0] for name in description.joint_names]
    return np.linalg.inv(mass)[np.ix_(dofs, dofs)]


def _fastest(mobility: np.ndarray, gains: np.ndarray) -> tuple[float, int]:
    """Largest eigenvalue of mobility times gains, and the joint that moves most in its mode."""
    root = np.sqrt(gains)
    values, modes = np.linalg.eigh(root[:, None] * mobility * root)
    return float(values[-1]), int(np.abs(modes[:, -1]).argmax())
