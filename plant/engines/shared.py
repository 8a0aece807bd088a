"""Functions that engines other than MuJoCo use to read a MuJoCo model and to update its state."""

from collections.abc import Collection, Mapping
from typing import Any

import mujoco
import numpy as np

from footfall.common.errors import UserError

WORLD = 0  # body
HINGE, FREE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_FREE


def collidable(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms may touch something, (ngeom,) bool."""
    mask = (model.geom_contype | model.geom_conaffinity) != 0
    mask[model.pair_geom1] = mask[model.pair_geom2] = True
    return mask


def check_model(
    engine: str, model: mujoco.MjModel, shapes: Collection[mujoco.mjtGeom], other_features: Mapping[str, Any]
) -> None:
    """Raise UserError if an engine would simulate another robot than MuJoCo.

    Args:
        engine: its name, as in `--engine`.
        model: the bodies.
        shapes: types of geoms that it knows.
        other_features: further features that it does not simulate, each true if the model has it.
    """
    types = {mujoco.mjtGeom(kind) for kind in model.geom_type[collidable(model)].tolist()}
    unsupported = sorted(each.name for each in types.difference(shapes))
    features = {
        f"collision geometry of type {', '.join(unsupported)}": unsupported,
        "joints other than hinges and a free base": set(model.jnt_type.tolist()) - {int(HINGE), int(FREE)},
        "springs in joints": model.jnt_stiffness.any(),
        "tendons or equality constraints": model.ntendon or model.neq,
        **other_features,
    }
    for feature, present in features.items():
        if present:
            raise UserError(f"--engine {engine} does not simulate {feature}: leave it out")


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
