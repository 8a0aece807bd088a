"""What engines other than MuJoCo read from a MuJoCo model, and compute of its state."""

import mujoco
import numpy as np

WORLD = 0  # body
HINGE, FREE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_FREE


def collidable(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms may touch something, (ngeom,) bool."""
    found = (model.geom_contype | model.geom_conaffinity) != 0
    found[model.pair_geom1] = found[model.pair_geom2] = True
    return found


def generalised_force(model: mujoco.MjModel, data: mujoco.MjData, applied: np.ndarray) -> None:
    """Write all applied forces into `applied`, (nv,), as MuJoCo's generalised forces."""
    applied[:] = data.qfrc_applied
    for body in np.flatnonzero(data.xfrc_applied.any(axis=1)).tolist():
        wrench = data.xfrc_applied[body]
        mujoco.mj_applyFT(model, data, wrench[:3], wrench[3:], data.xipos[body], body, applied)


def update_derived(model: mujoco.MjModel, data: mujoco.MjData, acceleration: np.ndarray) -> None:
    """Update the values that MuJoCo derives from the state: poses and velocities of bodies, IMU readings.

    Args:
        model: the bodies.
        data: their state, after a step.
        acceleration: mean generalised acceleration over the step, (nv,).
    """
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_comVel(model, data)
    data.qacc[:] = acceleration
    data.cfrc_ext[:] = 0.0
    mujoco.mj_rnePostConstraint(model, data)
    mujoco.mj_sensorAcc(model, data)
