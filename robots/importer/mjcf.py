"""Reads an MJCF; refuses features that footfall cannot simulate."""

import re
from pathlib import Path

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.importer.shapes import hull_points, rotation_of
from footfall.robots.importer.source import Source, compiled, free_the_base, limit_hinges, name_everything
from footfall.robots.mjcf import load_spec

STANDING = re.compile("stand|home|default", re.IGNORECASE)
LOOPS = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)


def read_mjcf(path: Path) -> Source:
    """Read an MJCF. See `read_source`."""
    spec = load_spec(path)
    if not spec.joints:
        raise UserError(f"{path} has no joints")
    name_everything(spec)
    free_the_base(spec, path)
    model = compiled(spec, path)
    for index in np.flatnonzero(np.isin(model.eq_type, LOOPS) & model.eq_active0.astype(bool)):
        name = model.equality(int(index)).name or f"number {index}"
        raise UserError(f"{path}: equality {name} closes a loop of links, which footfall does not simulate")
    coupled = model.eq_obj1id[model.eq_type == mujoco.mjtEq.mjEQ_JOINT]
    return Source(
        path=path,
        model=model,
        self_collisions=True,
        meshes=_meshes(model),
        peak_torque_nm=_peak_torques(model),
        pose_rad=_pose(model),
        coupled=frozenset(model.joint(int(joint)).name for joint in coupled),
        guesses=(
            *limit_hinges(model),
            *([f"{model.ntendon} tendons were ignored"] if model.ntendon else []),
        ),
    )


def _pose(model: mujoco.MjModel) -> dict[str, float]:
    """Joint positions by name, from the first keyframe with a name such as `stand`, or else the first one."""
    names = {key: model.key(key).name for key in range(model.nkey)}
    # The size nkey reserves keyframes without a name, in which every joint is at its initial position.
    given = [key for key, name in names.items() if name or (model.key_qpos[key] != model.qpos0).any()]
    if not given:
        return {}
    key = next((key for key in given if STANDING.search(names[key])), given[0])
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE).tolist()
    return {model.joint(j).name: float(model.key_qpos[key, model.jnt_qposadr[j]]) for j in hinges}


def _meshes(model: mujoco.MjModel) -> dict[str, np.ndarray]:
    found = {}
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH).tolist():
        mesh = int(model.geom_dataid[geom])
        start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        points = model.mesh_vert[start : start + count] @ rotation_of(model.geom_quat[geom]).T
        found[model.geom(geom).name] = hull_points(points + model.geom_pos[geom])
    return found


def _peak_torques(model: mujoco.MjModel) -> dict[str, float]:
    """Largest torque of each joint, N m, by name: that of its actuators, within the joint's own limit."""
    found: dict[str, float] = {}
    for joint in range(model.njnt):
        limits = []
        if model.jnt_actfrclimited[joint]:
            limits.append(np.abs(model.jnt_actfrcrange[joint]).max())
        driven = (model.actuator_trntype == mujoco.mjtTrn.mjTRN_JOINT) & (model.actuator_trnid[:, 0] == joint)
        given = [_actuator_torque(model, int(index)) for index in np.flatnonzero(driven)]
        if given and None not in given:
            limits.append(sum(torque for torque in given if torque is not None))
        positive = [float(limit) for limit in limits if limit > 0]
        if positive:
            found[model.joint(joint).name] = min(positive)
    return found


def _actuator_torque(model: mujoco.MjModel, index: int) -> float | None:
    """Largest torque of an actuator at its joint, N m; None if unlimited."""
    gear = abs(model.actuator_gear[index, 0])
    if model.actuator_forcelimited[index]:
        return gear * np.abs(model.actuator_forcerange[index]).max()
    plain = model.actuator_biastype[index] == mujoco.mjtBias.mjBIAS_NONE
    if plain and model.actuator_ctrllimited[index]:
        return gear * model.actuator_gainprm[index, 0] * np.abs(model.actuator_ctrlrange[index]).max()
    return None
