"""The model to import: the compiled model, and the motor figures of its file."""

from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np

from footfall.common.errors import UserError


@dataclass(frozen=True)
class Source:
    """A model with a free base, compiled by MuJoCo. Every body, joint and geom has a name."""

    path: Path
    model: mujoco.MjModel
    self_collisions: bool  # whether the file defines which parts can collide
    meshes: dict[str, np.ndarray]  # hull (k, 3) m of each geom that is a mesh, in the frame of its body
    peak_torque_nm: dict[str, float] = field(default_factory=dict)  # of joints with a torque in the file
    speed_rad_s: dict[str, float] = field(default_factory=dict)
    pose_rad: dict[str, float] = field(default_factory=dict)  # a pose of the file, if there is one
    coupled: frozenset[str] = frozenset()  # joints that follow another joint
    guesses: tuple[str, ...] = ()  # assumptions, one line each


def name_everything(spec: mujoco.MjSpec) -> None:
    """Name each body, joint and geom that has no name: later steps use names."""
    for body in spec.bodies[1:]:
        body.name = body.name or _new_name(spec.bodies, f"{body.parent.name}_child")
    for geom in spec.geoms:
        geom.name = geom.name or _new_name(spec.geoms, f"{geom.parent.name}_geom")
    for joint in spec.joints:
        joint.name = joint.name or _new_name(spec.joints, f"{joint.parent.name}_joint")


def free_the_base(spec: mujoco.MjSpec, path: Path) -> None:
    """Give the tree with the most joints a free joint, unless there is one already.

    Raises:
        UserError: there are no joints, or the base has other joints.
    """
    if any(joint.type == mujoco.mjtJoint.mjJNT_FREE for joint in spec.joints):
        return
    if not spec.joints:
        raise UserError(f"{path} has no joints")
    base = max(spec.worldbody.bodies, key=lambda body: len(body.find_all("joint")))
    if base.joints:
        raise UserError(
            f"{path}: '{base.name}' has no free joint but {len(base.joints)} others, such as"
            f" '{base.joints[0].name}': footfall needs a base that can move in all directions"
        )
    base.add_freejoint(name=_new_name(spec.joints, "floating_base"))


def limit_hinges(model: mujoco.MjModel) -> list[str]:
    """Give hinges without a range ±180 degrees; returns that guess, or nothing if all have a range."""
    hinges = (model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE) & (model.jnt_limited == 0)
    model.jnt_range[hinges] = -np.pi, np.pi
    model.jnt_limited[hinges] = 1
    names = [model.joint(int(joint)).name for joint in np.flatnonzero(hinges)]
    return [f"range of joints without limits: -3.14 to 3.14 rad: {', '.join(names)}"] if names else []


def compiled(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """The compiled model; raises UserError with MuJoCo's message."""
    try:
        return spec.compile()
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(f"{path}: {one_line(error)}") from None


def one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _new_name(items: list, stem: str) -> str:
    names = {item.name for item in items}
    return next(name for index in range(len(names) + 1) if (name := f"{stem}{index or ''}") not in names)
