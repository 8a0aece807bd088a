"""What engines other than MuJoCo read from a MuJoCo model, and compute of its state."""

from collections.abc import Collection, Mapping
from typing import Any

import mujoco
import numpy as np

from footfall.common.errors import UserError

WORLD = 0  # body
HINGE, FREE = mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_FREE


def collidable(model: mujoco.MjModel) -> np.ndarray:
    """Which geoms may touch something, (ngeom,) bool."""
    found = (model.geom_contype | model.geom_conaffinity) != 0
    found[model.pair_geom1] = found[model.pair_geom2] = True
    return found


def check_model(
    engine: str, model: mujoco.MjModel, shapes: Collection[mujoco.mjtGeom], others: Mapping[str, Any]
) -> None:
    """Raise UserError if an engine would simulate another robot than MuJoCo.

    Args:
        engine: its name, as in `--engine`.
        model: the bodies.
        shapes: types of geoms that it knows.
        others: further features that it does not simulate, each with whether the model has it.
    """
    found = {mujoco.mjtGeom(kind) for kind in model.geom_type[collidable(model)].tolist()}
    strange = sorted(each.name for each in found.difference(shapes))
    features = {
        f"collision geometry of type {', '.join(strange)}": strange,
        "joints other than hinges and a free base": set(model.jnt_type.tolist()) - {int(HINGE), int(FREE)},
        "springs in joints": model.jnt_stiffness.any(),
        "tendons or equality constraints": model.ntendon or model.neq,
        **others,
    }
    for feature, has in features.items():
        if has:
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
