"""Reward terms: functions of the data of one control step, or classes with a state of their own.

A term returns a number; the configuration gives its weight, in reward per second. A class with a state has
the methods `init` and `step` (envs/task.py).
"""

from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np

from footfall.common.errors import UserError
from footfall.common.terms import Between
from footfall.envs.terms.data import StepData

Width = Annotated[float, Between(1e-6, 1e6)]
Length = Annotated[float, Between(0.001, 1.0)]


def in_full(term: Callable[..., jax.Array]) -> Callable[..., jax.Array]:
    """Decorator of a reward for the end of an episode, which `reward_floor` does not clip.

    Its value is at most 1. A diverged simulation earns the weights of these terms.
    """
    term.in_full = True  # type: ignore[attr-defined]
    return term


def track_linear(data: StepData, *, sigma_m2_s2: Width = 0.25) -> jax.Array:
    """exp(-error^2 / sigma) of the commanded horizontal velocity: 1 without error."""
    error = jnp.sum((data.command[:2] - data.linear_velocity[:2]) ** 2)
    return jnp.exp(-error / sigma_m2_s2)


def track_yaw(data: StepData, *, sigma_rad2_s2: Width = 0.25) -> jax.Array:
    """exp(-error^2 / sigma) of the commanded yaw rate: 1 without error."""
    return jnp.exp(-((data.command[2] - data.angular_velocity[2]) ** 2) / sigma_rad2_s2)


def alive(data: StepData) -> jax.Array:
    """1 until the episode ends."""
    return 1.0 - data.fell


@in_full
def fall(data: StepData) -> jax.Array:
    """1 when a termination term ends the episode."""
    return data.fell


def gait_contact(data: StepData) -> jax.Array:
    """Share of feet whose contact agrees with the gait clock."""
    planned = 1.0 - (data.swing > 0)
    return jnp.mean(1.0 - jnp.abs(planned - data.contact))


def swing_height(data: StepData, *, height_m: Length = 0.08) -> jax.Array:
    """Squared error of the swing feet's clearance against the planned swing of `height_m`, m^2."""
    return jnp.sum(jnp.where(data.swing > 0, (data.clearance - height_m * data.swing) ** 2, 0.0))


def vertical_velocity(data: StepData) -> jax.Array:
    """Squared vertical velocity of the base, m^2/s^2."""
    return data.linear_velocity[2] ** 2


def roll_pitch_rate(data: StepData) -> jax.Array:
    """Squared angular velocity about the horizontal axes of the body, rad^2/s^2."""
    return jnp.sum(data.angular_velocity[:2] ** 2)


def orientation(data: StepData) -> jax.Array:
    """Squared sine of the tilt: gravity's share along the body's horizontal axes."""
    return jnp.sum(data.gravity[:2] ** 2)


def upright(data: StepData) -> jax.Array:
    """1 upright, 0.5 on a side, 0 upside down."""
    return 0.5 * (1.0 - data.gravity[2])


def raised(data: StepData) -> jax.Array:
    """Height of the base as a share of the standing height, at most 1, where the base is upright."""
    share = jnp.clip(data.height / data.scene.standing_height, 0.0, 1.0)
    return upright(data) ** 2 * share


def stands(
    data: StepData,
    *,
    tilt_rad: Width = 0.3,
    height_m: Width = 0.05,
    pose_rad: Width = 0.5,
    speed_rad_s: Width = 2.0,
) -> jax.Array:
    """1 standing upright and still in the default pose: a product of Gaussians with these widths.

    The widths of pose and speed apply to the root mean square over the joints.
    """
    errors = (
        jnp.sum(data.gravity[:2] ** 2) / tilt_rad**2 + 10.0 * (data.gravity[2] > 0.0),
        (data.height - data.scene.standing_height) ** 2 / height_m**2,
        jnp.mean((data.joint_position - data.scene.default_pose) ** 2) / pose_rad**2,
        jnp.mean(data.joint_velocity**2) / speed_rad_s**2,
    )
    return jnp.exp(-sum(errors))


def joint_speed(data: StepData, *, free_rad_s: Annotated[float, Between(0.0, 100.0)] = 0.0) -> jax.Array:
    """Squared excess of the joints' speeds over `free_rad_s`, summed, rad^2/s^2."""
    return jnp.sum(jnp.maximum(jnp.abs(data.joint_velocity) - free_rad_s, 0.0) ** 2)


def height(data: StepData) -> jax.Array:
    """Squared difference of the base's height from the standing height, m^2."""
    return (data.height - data.scene.standing_height) ** 2


def torque(data: StepData) -> jax.Array:
    """Sum of squared motor torques, N^2 m^2."""
    return jnp.sum(data.torque**2)


def power(data: StepData) -> jax.Array:
    """Sum of the motors' mechanical power, driving and braking, W."""
    return jnp.sum(jnp.abs(data.torque * data.joint_velocity))


def action_rate(data: StepData) -> jax.Array:
    """Squared change of the action since the last step."""
    return jnp.sum((data.actions[0] - data.actions[1]) ** 2)


def action_acceleration(data: StepData) -> jax.Array:
    """Squared change of the action's change."""
    return jnp.sum((data.actions[0] - 2 * data.actions[1] + data.actions[2]) ** 2)


def pose(data: StepData, *, joint_shares: dict[str, float] | None = None) -> jax.Array:
    """Squared deviation of the joints from the default pose, rad^2.

    Args:
        data: data of the step.
        joint_shares: weight of each joint, by pattern of names (*, ?, [...]); the first pattern that
            matches a name applies, and a joint that no pattern matches has weight 1.
    """
    shares = _shares(data.scene.robot.joint_names, joint_shares or {})
    return jnp.sum(shares * (data.joint_position - data.scene.default_pose) ** 2)


def stand_still(data: StepData) -> jax.Array:
    """Deviation from the default pose while the command is to stand, rad."""
    return (1.0 - data.moving) * jnp.sum(jnp.abs(data.joint_position - data.scene.default_pose))


def joint_limits(data: StepData) -> jax.Array:
    """Excess of the joints over their soft limits, rad, summed."""
    below = jnp.maximum(data.scene.soft_lower - data.joint_position, 0.0)
    above = jnp.maximum(data.joint_position - data.scene.soft_upper, 0.0)
    return jnp.sum(below + above)


def slip(data: StepData) -> jax.Array:
    """Squared horizontal speed of the feet in contact, m^2/s^2."""
    return jnp.sum(data.contact * data.foot_speed**2)


def level_soles(data: StepData) -> jax.Array:
    """Squared height of each sole's highest point above its lowest, m^2; 0 for sphere feet."""
    return jnp.sum(data.foot_tilt**2)


def crowded_feet(data: StepData, *, distance_m: Length = 0.12) -> jax.Array:
    """Squared shortfall of the horizontal distance between two feet below `distance_m`, summed, m^2."""
    return data.scene.feet.crowding(data.foot_position, distance_m)


def collision(data: StepData) -> jax.Array:
    """Depth of points on trunk, thighs and shanks below the ground, m, summed: see `Scene.body`."""
    return jnp.sum(jnp.maximum(data.depth, 0.0))


def feet_near_edges(data: StepData, *, distance_m: Length = 0.03, step_m: Length = 0.05) -> jax.Array:
    """Number of feet in contact within `distance_m` of a step of at least `step_m`, up or down."""
    around = distance_m * jnp.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    centres = data.scene.feet.centres(data.foot_position)[:, :2]
    heights = data.ground(centres[:, None] + around)
    return jnp.sum(data.contact * (jnp.ptp(heights, axis=1) >= step_m))


REWARDS: dict[str, Callable[..., Any]] = {
    function.__name__: function
    for function in (
        track_linear,
        track_yaw,
        alive,
        fall,
        gait_contact,
        swing_height,
        vertical_velocity,
        roll_pitch_rate,
        orientation,
        upright,
        raised,
        stands,
        joint_speed,
        height,
        torque,
        power,
        action_rate,
        action_acceleration,
        pose,
        stand_still,
        joint_limits,
        slip,
        level_soles,
        crowded_feet,
        collision,
        feet_near_edges,
    )
}


def _shares(joint_names: Sequence[str], by_pattern: dict[str, float]) -> jax.Array:
    """The share of the first pattern that matches each joint's name, 1 if none does, (n,)."""
    for pattern in by_pattern:
        if not any(fnmatchcase(name, pattern) for name in joint_names):
            raise UserError(f"joint_shares: no joint matches '{pattern}'")
    matching = ([share for p, share in by_pattern.items() if fnmatchcase(name, p)] for name in joint_names)
    shares = np.array([each[0] if each else 1.0 for each in matching])
    return jnp.asarray(shares, dtype=jnp.float32)
