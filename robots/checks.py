"""Checks of `robot.yaml`, alone and against the MJCF. Each finding is one line."""

from collections.abc import Iterator, Sequence

import mujoco
import numpy as np

from footfall.robots.robot_yaml import SERIAL, Description, Foot
from footfall.robots.stance import lying_clearance, touching_height
from footfall.robots.targets import soft_limits

STANDING_TOLERANCE_M = 0.005
MAX_FEET = 16  # number of identifiers for force sensors
LYING_SHARE = 0.1  # largest height of a lying robot's base above the ground, over its standing height


def inconsistencies(description: Description) -> Iterator[str]:
    """Contradictions within `robot.yaml`."""
    names = [joint.name for joint in description.joints]
    if not names or not description.feet:
        yield "a robot needs at least one joint and one foot"
    if _repeated(names):
        yield f"joints: {_repeated(names)} is listed twice"
    if _repeated([(joint.bus, joint.id) for joint in description.joints]):
        yield "joints: two joints share a bus and an id"
    for joint in description.joints:
        if joint.motor not in description.motors:
            known = ", ".join(description.motors)
            yield f"joint {joint.name}: no motor '{joint.motor}' under motors ({known})"
    sensors = [foot.force_bus for foot in description.feet if foot.force_bus is not None]
    buses = {*(joint.bus for joint in description.joints), description.imu_bus, *sensors}
    frame = description.stop_inputs.frame
    on_can = {*(joint.bus for joint in description.joints), *sensors, *([] if frame is None else [frame.bus])}
    for bus in sorted(each for each in on_can if each.startswith(SERIAL)):
        yield f"bus '{bus}': motors, force sensors and stop frames are on CAN; a serial port carries an IMU"
    if frame is not None and frame.bus not in buses:
        yield f"stop_inputs.frame: no joint and no IMU is on bus '{frame.bus}' ({', '.join(sorted(buses))})"
    without_lying = [joint.name for joint in description.joints if joint.lying_rad is None]
    if without_lying and len(without_lying) < len(names):
        yield f"joint {without_lying[0]} has no lying_rad, though other joints have one"
    unequipped = [foot.name for foot in description.feet if foot.force_bus is None]
    if sensors and unequipped:
        yield f"foot {unequipped[0]} has no force_bus, though other feet have one"
    yield from _wrong_feet(description.feet, names)


def _wrong_feet(feet: Sequence[Foot], joints: list[str]) -> Iterator[str]:
    if len(feet) > MAX_FEET and feet[0].force_bus is not None:
        yield f"feet: {len(feet)} with force sensors, {MAX_FEET} at most"
    if _repeated([foot.name for foot in feet]):
        yield f"feet: {_repeated([foot.name for foot in feet])} is listed twice"
    geoms = [name for foot in feet for name in foot.geoms]
    if _repeated(geoms):
        yield f"feet: geom {_repeated(geoms)} is listed twice"
    for foot in feet:
        if _repeated(foot.joints):
            yield f"foot {foot.name}: joint {_repeated(foot.joints)} is listed twice"
        for name in foot.joints:
            if name not in joints:
                yield f"foot {foot.name}: no joint '{name}' under joints"
        if not foot.joints:
            yield f"foot {foot.name}: its leg needs a joint at least"


def contradictions(description: Description, model: mujoco.MjModel) -> Iterator[str]:
    """Contradictions between `robot.yaml` and the compiled MJCF."""
    kinds, feet = mujoco.mjtObj, description.feet
    for field, kind, name in (
        ("base", kinds.mjOBJ_BODY, description.base),
        ("imu", kinds.mjOBJ_SITE, description.imu),
        *(("joints", kinds.mjOBJ_JOINT, joint.name) for joint in description.joints),
        *((f"foot {foot.name}: geoms", kinds.mjOBJ_GEOM, name) for foot in feet for name in foot.geoms),
    ):
        if mujoco.mj_name2id(model, kind, name) < 0:
            yield f"{field}: {description.model} has no {kind.name[6:].lower()} '{name}'"
            return  # the checks below look these names up
    base = model.body(description.base).id
    free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
    if base not in free:
        yield f"base: body '{description.base}' has no free joint in {description.model}"
    if model.site(description.imu).bodyid[0] != base:
        yield f"imu: site '{description.imu}' is not on the base '{description.base}'"
    for foot in description.feet:
        if len({int(model.geom(name).bodyid[0]) for name in foot.geoms}) > 1:
            yield f"foot {foot.name}: its geoms are on different bodies in {description.model}"
    yield from _wrong_joints(description, model)
    touching_m = touching_height(description, model)
    if abs(touching_m - description.standing_height_m) > STANDING_TOLERANCE_M:
        yield (
            f"standing_height_m: the feet touch the ground in the default pose with '{description.base}' at"
            f" {touching_m:.4f} m, not at {description.standing_height_m:g}"
        )
    if description.joints[0].lying_rad is not None:
        clearance_m = lying_clearance(description, model)
        if clearance_m > LYING_SHARE * description.standing_height_m:
            yield f"lying_rad: '{description.base}' is {clearance_m:.3f} m above the feet, not on the ground"


def _wrong_joints(description: Description, model: mujoco.MjModel) -> Iterator[str]:
    for joint in description.joints:
        found = model.joint(joint.name)
        dof, (low, high) = found.dofadr[0], found.range
        soft_low, soft_high = soft_limits(low, high, description.soft_limit_factor)
        if found.type[0] != mujoco.mjtJoint.mjJNT_HINGE:
            yield f"joint {joint.name} is not a hinge in {description.model}"
        elif not model.jnt_limited[found.id]:
            yield f"joint {joint.name} has no range in {description.model}"
        elif not found.armature[0] > 0.0:
            yield f"joint {joint.name} has no armature in {description.model}: the gains follow from it"
        elif not low <= joint.default_rad <= high:
            yield f"joint {joint.name}: default_rad {joint.default_rad:g} is outside {low:g} to {high:g}"
        elif not soft_low <= joint.default_rad <= soft_high:
            yield (
                f"joint {joint.name}: default_rad {joint.default_rad:g} is outside the soft limits"
                f" {soft_low:.4g} to {soft_high:.4g}, which soft_limit_factor leaves of its range"
            )
        elif joint.lying_rad is not None and not soft_low <= joint.lying_rad <= soft_high:
            yield (
                f"joint {joint.name}: lying_rad {joint.lying_rad:g} is outside the soft limits"
                f" {soft_low:.4g} to {soft_high:.4g}"
            )
        elif model.dof_frictionloss[dof] < 0.0 or model.dof_damping[dof] < 0.0:
            yield f"joint {joint.name}: frictionloss and damping in {description.model} must not be negative"
        elif model.dof_dampingpoly[dof].any():
            yield f"joint {joint.name}: damping in {description.model} must be one number, N m s/rad"


def overreach(description: Description, action_scale: np.ndarray, span: np.ndarray) -> Iterator[str]:
    """Joints that an action of 1 would move by more than their range.

    Args:
        description: description of the robot.
        action_scale: position target per unit of action, rad, (n,).
        span: each joint's range, rad, (n,).
    """
    for name, scale, width in zip(description.joint_names, action_scale, span, strict=True):
        if scale > width:
            yield (
                f"gains: torque_share times the peak torque over kp lets an action of 1 move joint {name} by"
                f" {scale:.3g} rad, its range is {width:.3g}"
            )


def _repeated(items: Sequence) -> object:
    """An item that occurs more than once, or None."""
    return next((item for item in items if items.count(item) > 1), None)
