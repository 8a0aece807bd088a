"""Criteria of the steps: each function checks samples and yields a sentence for each failure."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.bring_up.config import BringUpLimits
from footfall.deploy.bring_up.recording import Samples
from footfall.robots.description import Robot
from footfall.robots.rigid_body import nominal_body

MIN_TILT_SHARE = 0.3  # of the commanded tilt, by the joints
MAX_POSES = 50  # evaluated poses in a window


class Window(NamedTuple):
    """A part of a step, with the joints that move in it."""

    begin_s: float
    end_s: float
    joints: tuple[int, ...] = ()
    sway_axis: str = ""  # axis of the base's tilt: roll or pitch


class Case(NamedTuple):
    """Input of a criterion."""

    robot: Robot
    labels: list[str]  # names of the joints with their motors, for sentences
    window: Window
    samples: Samples
    limits: BringUpLimits


Criterion = Callable[[Case], Iterator[str]]


def follow(case: Case) -> Iterator[str]:
    """Moving joints travel as far as their targets, and the others stay in place."""
    position, target = (values - values[0] for values in (case.samples.position, case.samples.target))
    moving = list(case.window.joints)
    low, high = case.limits.follows
    travel = np.abs(position).max(axis=0)
    others = [j for j in range(len(travel)) if j not in moving and travel[j] > case.limits.still_rad]
    for joint in moving:
        label, target_angle = case.labels[joint], target[:, joint]
        share = float(position[:, joint] @ target_angle / (target_angle @ target_angle))
        if low <= share <= high:
            continue
        if others and abs(share) < low:
            yield f"{label} should move, but {case.labels[others[0]]} does: their ids or plugs are swapped"
            return
        if share < -low:
            yield f"{label} turns in the wrong direction: its sign is wrong"
        elif share < low:
            yield f"{label} covers {share:.0%} of its travel: it has no power, or is blocked"
        else:
            yield f"{label} covers {share:.0%} of its travel: its gear ratio is wrong"
    for joint in others:
        yield f"{case.labels[joint]} moves by {travel[joint]:.2f} rad, but should not"


def calm(case: Case) -> Iterator[str]:
    """No joint shakes."""
    samples = case.samples
    step_s = float(np.diff(samples.time_s).mean())
    count = max(1, round(case.limits.shaking_s / step_s))
    if len(samples.time_s) <= 2 * count:
        return
    mean = np.apply_along_axis(np.convolve, 0, samples.velocity, np.ones(count) / count, "valid")
    deviation = samples.velocity[count // 2 : count // 2 + len(mean)] - mean
    shaking = np.sqrt((deviation**2).mean(axis=0))
    joint = int(shaking.argmax())
    if shaking[joint] > case.limits.shaking_rad_s:
        yield f"{case.labels[joint]} shakes with {shaking[joint]:.1f} rad/s: lower its gains"


def modest(case: Case) -> Iterator[str]:
    """No motor needs more than a given share of its peak torque."""
    share = np.percentile(np.abs(case.samples.torque), 99, axis=0) / case.robot.motor.peak_torque
    joint = int(share.argmax())
    if share[joint] > case.limits.torque_share:
        yield f"{case.labels[joint]} needs {share[joint]:.0%} of its peak torque"


def cool(case: Case) -> Iterator[str]:
    """No motor is hot; a motor without temperature readings passes."""
    hottest = np.nan_to_num(case.samples.temperature_c, nan=-np.inf).max(axis=0)
    joint = int(hottest.argmax())
    if hottest[joint] > case.limits.temperature_c:
        yield f"{case.labels[joint]} is at {hottest[joint]:.0f} degrees Celsius"


def level(case: Case) -> Iterator[str]:
    """The base is level on average."""
    for name, angle in (("roll", case.samples.roll), ("pitch", case.samples.pitch)):
        mean = float(angle.mean())
        if abs(mean) > case.limits.tilt_rad:
            yield f"the base's {name} is {mean:+.2f} rad: a joint's zero or the IMU's mounting is wrong"


def upright(case: Case) -> Iterator[str]:
    """The tilt of the base stays below its limit."""
    tilt = float(np.hypot(case.samples.roll, case.samples.pitch).max())
    if tilt > case.limits.uneven_tilt_rad:
        yield f"the base tilts by {tilt:.2f} rad: try lower obstacles, or another policy"


def carry(case: Case) -> Iterator[str]:
    """The reported torques carry the robot's weight, and every leg carries a part of it.
    For a force f of the ground on a leg at rest, the joint torques are -J^T f.
    """
    robot, limits = case.robot, case.limits
    legs = robot.legs
    weight = GRAVITY_M_S2 * nominal_body(robot).mass
    jacobian = legs.pose(case.samples.position.mean(axis=0)).jacobian
    torque = legs.gather(case.samples.torque.mean(axis=0))
    carried = np.array(
        [-np.linalg.lstsq(j.T, t, rcond=None)[0][2] for j, t in zip(jacobian, torque, strict=True)]
    )
    share = float(carried.sum()) / weight
    low, high = limits.carries
    if not low <= share <= high:
        yield f"according to their torques, the legs carry {share:.0%} of the robot's weight"
        return
    for foot, force in zip(robot.description.feet, carried, strict=True):
        if force < limits.min_leg_share * weight / legs.count:
            yield f"leg {foot.name} carries {force:.0f} N of {weight:.0f}: a zero, a ratio or a sign is wrong"


def sway(case: Case) -> Iterator[str]:
    """The base's tilt by the IMU equals its tilt by the joints, with all feet on the ground."""
    legs, samples = case.robot.legs, case.samples
    subset = slice(None, None, max(1, len(samples.time_s) // MAX_POSES))
    target_angle, by_joints = (
        _planes(np.array([legs.pose(row).foot for row in poses[subset]]))[case.window.sway_axis]
        for poses in (samples.target, samples.position)
    )
    by_imu = getattr(samples, case.window.sway_axis)[subset]
    target_angle, by_joints, by_imu = (
        target_angle - target_angle[0],
        by_joints - by_joints[0],
        by_imu - by_imu[0],
    )
    low, high = case.limits.tilts
    if np.abs(by_joints).max() < MIN_TILT_SHARE * np.abs(target_angle).max():
        yield "the legs do not tilt the base: check gains and torques"
    elif not low <= (share := float(by_imu @ by_joints / (by_joints @ by_joints))) <= high:
        yield (
            f"the base's {case.window.sway_axis} by the IMU is {share:.0%} of that by the joints:"
            " a gear ratio, a zero or the IMU's mounting is wrong"
        )


def _planes(feet: np.ndarray) -> dict[str, np.ndarray]:
    """Roll and pitch, rad, (T,), of a base whose feet (T, legs, 3), base frame, stand on level ground."""
    centred = feet - feet.mean(axis=1, keepdims=True)
    slopes = np.array([np.linalg.lstsq(each[:, :2], each[:, 2], rcond=None)[0] for each in centred])
    return {"roll": -np.arctan(slopes[:, 1]), "pitch": np.arctan(slopes[:, 0])}
