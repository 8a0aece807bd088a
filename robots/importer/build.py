"""Builds a machine from a source: finds legs, freezes other joints, chooses feet."""

from collections import Counter
from dataclasses import replace

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.importer.feet import leg_names, stand_on
from footfall.robots.importer.limbs import Limbs, base_of, find_limbs
from footfall.robots.importer.machine import Geom, Link, Machine, build_links, frozen_pose, pose_of
from footfall.robots.importer.model_xml import FOOT_FRICTION
from footfall.robots.importer.orientation import guessed_forward, original_axis, with_base_axes
from footfall.robots.importer.source import Source

MAX_NAMES = 4  # names listed in a message; further ones are counted


def build_machine(
    source: Source, name: str, feet: tuple[str, ...] = (), forward: str = "", up: str = "z"
) -> tuple[Machine, list[str]]:
    """A legged machine, and the guesses made, one line each.

    Args:
        source: the model.
        name: the name of the robot.
        feet: see `find_limbs`.
        forward: axis of the base that points forward, such as "-x"; empty: guessed by the legs' names.
        up: axis that points up.

    Raises:
        UserError: the source is not a legged machine that footfall supports; the message has the reason.
    """
    x_axis = forward or ("y" if up.endswith("x") else "x")
    if forward or up != "z":
        source = with_base_axes(source, base_of(source.model), x_axis, up)
    limbs = find_limbs(source, feet)
    forward_axis = "x" if forward else guessed_forward(source, limbs)  # after the rotation above
    if forward_axis != "x":
        source = with_base_axes(source, limbs.base, forward_axis)
    model = source.model
    uses = Counter(joint for limb in limbs.legs for joint in limb.joints)
    links = list(build_links(source, limbs.base, set(uses)))
    if not source.self_collisions:
        links = [_with_friction(link, FOOT_FRICTION) for link in links]
    data = pose_of(model, frozen_pose(model, set()))
    ends = [limb.bodies[0] for limb in limbs.legs]
    legs = []
    for limb, end, leg_name in zip(
        limbs.legs, ends, leg_names([model.body(end).name for end in ends]), strict=True
    ):
        index = next(i for i, link in enumerate(links) if link.name == model.body(end).name)
        own_joints = tuple(joint for joint in limb.joints if uses[joint] == 1)
        upward = data.xmat[end].reshape(3, 3)[2]
        try:
            links[index], leg = stand_on(links[index], index, limb, own_joints, leg_name, upward)
        except UserError as error:
            raise UserError(f"{source.path}: {error}") from None
        legs.append(leg)
    imu, imu_guess = _imu(model, limbs.base)
    file_axis = original_axis(forward_axis, x_axis, up)
    base = f"base: '{model.body(limbs.base).name}', its {file_axis} axis pointing forward, {up} up"
    if forward_axis != "x":
        base += f", by the legs called left and right (--forward {x_axis} ignores their names)"
    guesses = [base, *source.guesses, *limbs.guesses, *_frozen_joints(source, limbs, set(uses)), imu_guess]
    if source.meshes:
        guesses.append(f"{len(source.meshes)} meshes were replaced by primitives")
    if not source.self_collisions:
        guesses.append(f"friction of the feet on the ground: {FOOT_FRICTION:g}")
    return Machine(name, tuple(links), tuple(legs), imu), guesses


def shortened(names: list[str]) -> str:
    """The first few names, and the number of the others."""
    more = len(names) - MAX_NAMES
    return ", ".join(names[:MAX_NAMES]) + (f" and {more} more" if more > 0 else "")


def _with_friction(link: Link, friction: float) -> Link:
    def with_friction(geom: Geom) -> Geom:
        return replace(geom, friction=friction)

    return replace(link, geoms=tuple(map(with_friction, link.geoms)))


def _frozen_joints(source: Source, limbs: Limbs, driven: set[str]) -> list[str]:
    """A line about the joints that become rigid, if any."""
    model = source.model
    names = [
        model.joint(j).name
        for j in range(model.njnt)
        if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE
        and model.joint(j).name not in driven
        and model.body_rootid[model.jnt_bodyid[j]] == limbs.base
    ]
    if not names:
        return []
    return [f"joints that move no foot are rigid, as near to zero as their ranges allow: {shortened(names)}"]


def _imu(model: mujoco.MjModel, base: int) -> tuple[np.ndarray, str]:
    """Position of the IMU in the base's frame, (3,) m, and a line with its source."""
    data = pose_of(model, model.qpos0)
    rotation, origin = data.xmat[base].reshape(3, 3), data.xpos[base]
    bodies = [("link", model.body(b).name, data.xpos[b], b) for b in range(model.nbody)]
    sites = [
        ("site", model.site(s).name, data.site_xpos[s], model.site_bodyid[s]) for s in range(model.nsite)
    ]
    for kind, name, position, body in (*sites, *bodies):
        if "imu" in name.lower() and model.body_weldid[body] == base:
            return rotation.T @ (position - origin), f"IMU: at {kind} {name}, along the axes of the base"
    return np.zeros(3), f"IMU: at the origin of '{model.body(base).name}', along its axes"
