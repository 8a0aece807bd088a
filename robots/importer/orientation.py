"""Orientation of a base: rotates its frame so that x points forward and z up; guesses forward by names."""

import copy
import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from footfall.common.errors import UserError
from footfall.robots.importer.limbs import Limbs
from footfall.robots.importer.machine import frozen_pose, pose_of
from footfall.robots.importer.shapes import quaternion_of, rotation_of
from footfall.robots.importer.source import Source

AXES = {
    f"{sign}{name}": (-1.0 if sign else 1.0) * axis
    for sign in ("", "-")
    for name, axis in zip("xyz", np.eye(3), strict=True)
}
WORDS = {"l": "l", "left": "l", "r": "r", "right": "r"}
MIN_COSINE = 0.9  # smallest cosine of the angle between the guessed direction and an axis


def with_base_axes(source: Source, base: int, forward: str, up: str = "z") -> Source:
    """The source with other axes of its base: x forward, z up.

    Args:
        source: the model; it is not changed.
        base: body with the free joint.
        forward: axis of the base that becomes x, such as "-y".
        up: axis that becomes z.

    Raises:
        UserError: both are the same axis.
    """
    if abs(AXES[forward] @ AXES[up]) > 0.0:
        raise UserError(f"--forward {forward} and --up {up} are the same axis: they must be at right angles")
    axes = _new_axes(forward, up)
    model = copy.copy(source.model)
    for fixed, position, quaternion in (
        (np.flatnonzero(model.body_parentid == base), model.body_pos, model.body_quat),
        (np.flatnonzero(model.geom_bodyid == base), model.geom_pos, model.geom_quat),
        (np.flatnonzero(model.site_bodyid == base), model.site_pos, model.site_quat),
        (np.array([base]), model.body_ipos, model.body_iquat),
    ):
        for index in fixed.tolist():
            position[index] = axes @ position[index]
            quaternion[index] = quaternion_of(axes @ rotation_of(quaternion[index]))
    at = int(model.jnt_qposadr[model.body_jntadr[base]])
    model.qpos0[at + 3 : at + 7] = model.body_quat[base] = (1.0, 0.0, 0.0, 0.0)
    of_base = {model.geom(int(geom)).name for geom in np.flatnonzero(model.geom_bodyid == base)}
    meshes = {name: points @ axes.T if name in of_base else points for name, points in source.meshes.items()}
    return replace(source, model=model, meshes=meshes)


def original_axis(axis: str, forward: str, up: str) -> str:
    """The axis that was `axis` before `with_base_axes` made `forward` x and `up` z."""
    direction = AXES[axis] @ _new_axes(forward, up)
    return next(name for name, each in AXES.items() if each @ direction > MIN_COSINE)


def _new_axes(forward: str, up: str) -> np.ndarray:
    """Rows: the axes of `with_base_axes` in the old frame."""
    x, z = AXES[forward], AXES[up]
    return np.stack([x, np.cross(z, x), z])


def guessed_forward(source: Source, limbs: Limbs) -> str:
    """The horizontal axis of the base that points forward, guessed from legs that are named left and right.

    Returns:
        The axis; "x" if the names are unclear.
    """
    model = source.model
    data = pose_of(model, frozen_pose(model, set()))
    sides = side_letters(model.body(limb.bodies[0]).name for limb in limbs.legs)
    positions = np.array([data.xanchor[model.joint(limb.joints[0]).id] for limb in limbs.legs])
    legs = list(zip(positions, sides, strict=True))
    of_side = [[position for position, leg_side in legs if leg_side == side] for side in "lr"]
    if not all(of_side):
        return "x"
    left, right = (np.mean(each, axis=0) for each in of_side)
    across = data.xmat[limbs.base].reshape(3, 3).T @ (left - right)
    direction = np.cross(across, AXES["z"])
    direction /= max(float(np.linalg.norm(direction)), 1e-9)
    horizontal = {name: axis for name, axis in AXES.items() if name[-1] != "z"}
    return next((name for name, axis in horizontal.items() if axis @ direction > MIN_COSINE), "x")


def side_letters(names: Iterable[str]) -> list[str]:
    """Side of each leg, "l" or "r", by words or codes (FL, RH) in its last link's name; "" if unclear."""
    parts = [re.findall(r"[a-z]+", re.sub(r"([a-z])([A-Z])", r"\1_\2", name).lower()) for name in names]
    found = [next((WORDS[part] for part in words if part in WORDS), "") for words in parts]
    if all(found):
        return found
    codes = [
        next((part for part in words if len(part) == 2 and set(part) & {"l", "r"}), "") for words in parts
    ]
    letters = [index for index in (0, 1) if all(code and code[index] in "lr" for code in codes)]
    return [code[letters[0]] for code in codes] if len(letters) == 1 else [""] * len(parts)
