"""Rewards: small pure functions of what happened in one control step, weighted in configuration."""

from collections.abc import Callable, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from footfall.common.errors import UserError
from footfall.envs.config import RewardScales


class RewardInputs(NamedTuple):
    """What one control step led to. Vectors in the body frame unless said otherwise."""

    command: jax.Array  # (3,) forward m/s, leftward m/s, yaw rad/s
    moving: jax.Array  # () 1.0 if the command asks to move
    linear_velocity: jax.Array  # (3,) m/s
    angular_velocity: jax.Array  # (3,) rad/s
    gravity: jax.Array  # (3,) unit vector
    height: jax.Array  # () m, base above ground
    standing_height: float  # m
    joint_position: jax.Array  # (n,) rad
    joint_velocity: jax.Array  # (n,) rad/s
    default_pose: jax.Array  # (n,) rad
    pose_share: jax.Array  # (n,) how much each joint counts in `pose`
    soft_lower: jax.Array  # (n,) rad
    soft_upper: jax.Array  # (n,) rad
    torque: jax.Array  # (n,) N m, motor torque at the last physics step
    actions: jax.Array  # (3, n) newest first
    contact: jax.Array  # (feet,) 1.0 in contact
    clearance: jax.Array  # (feet,) m above ground
    foot_speed: jax.Array  # (feet,) m/s, horizontal
    foot_tilt: jax.Array  # (feet,) m, from a sole's lowest point up to its highest; 0 of a ball
    crowding: jax.Array  # () m^2, how much nearer than `foot_distance_m` feet are to each other
    swing: jax.Array  # (feet,) planned swing, 0 in stance, rising to 1 at mid-swing
    fell: jax.Array  # () 1.0 if the episode ended in a fall


def track_linear(i: RewardInputs, s: RewardScales) -> jax.Array:
    error = jnp.sum((i.command[:2] - i.linear_velocity[:2]) ** 2)
    return jnp.exp(-error / s.linear_sigma_m2_s2)


def track_yaw(i: RewardInputs, s: RewardScales) -> jax.Array:
    return jnp.exp(-((i.command[2] - i.angular_velocity[2]) ** 2) / s.yaw_sigma_rad2_s2)


def alive(i: RewardInputs, _: RewardScales) -> jax.Array:
    return 1.0 - i.fell


def fall(i: RewardInputs, _: RewardScales) -> jax.Array:
    return i.fell


def gait_contact(i: RewardInputs, _: RewardScales) -> jax.Array:
    """Share of feet whose contact is as the gait clock plans it."""
    planned = 1.0 - (i.swing > 0)
    return jnp.mean(1.0 - jnp.abs(planned - i.contact))


def swing_height(i: RewardInputs, s: RewardScales) -> jax.Array:
    """Squared error of the swing feet's height against a half sine."""
    return jnp.sum(jnp.where(i.swing > 0, (i.clearance - s.swing_height_m * i.swing) ** 2, 0.0))


def vertical_velocity(i: RewardInputs, _: RewardScales) -> jax.Array:
    return i.linear_velocity[2] ** 2


def roll_pitch_rate(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum(i.angular_velocity[:2] ** 2)


def orientation(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum(i.gravity[:2] ** 2)


def height(i: RewardInputs, _: RewardScales) -> jax.Array:
    return (i.height - i.standing_height) ** 2


def torque(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum(i.torque**2)


def power(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum(jnp.abs(i.torque * i.joint_velocity))


def action_rate(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum((i.actions[0] - i.actions[1]) ** 2)


def action_acceleration(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum((i.actions[0] - 2 * i.actions[1] + i.actions[2]) ** 2)


def pose(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum(i.pose_share * (i.joint_position - i.default_pose) ** 2)


def stand_still(i: RewardInputs, _: RewardScales) -> jax.Array:
    """Deviation from the default pose while asked to stand."""
    return (1.0 - i.moving) * jnp.sum(jnp.abs(i.joint_position - i.default_pose))


def joint_limits(i: RewardInputs, _: RewardScales) -> jax.Array:
    """How far joints are past their soft limits, rad."""
    below = jnp.maximum(i.soft_lower - i.joint_position, 0.0)
    above = jnp.maximum(i.joint_position - i.soft_upper, 0.0)
    return jnp.sum(below + above)


def slip(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum(i.contact * i.foot_speed**2)


def level_soles(i: RewardInputs, _: RewardScales) -> jax.Array:
    return jnp.sum(i.foot_tilt**2)


def crowded_feet(i: RewardInputs, _: RewardScales) -> jax.Array:
    """Feet so near to each other that legs may meet."""
    return i.crowding


TERMS: dict[str, Callable[[RewardInputs, RewardScales], jax.Array]] = {
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
    )
}


def joint_shares(joint_names: Sequence[str], by_pattern: dict[str, float]) -> np.ndarray:
    """What the first pattern that fits a joint's name gives it, 1 where none does, (n,).

    Raises:
        UserError: a pattern that no joint fits.
    """
    for pattern in by_pattern:
        if not any(fnmatchcase(name, pattern) for name in joint_names):
            raise UserError(f"reward_scales.pose_shares: no joint fits '{pattern}'")
    fitting = ([share for p, share in by_pattern.items() if fnmatchcase(name, p)] for name in joint_names)
    return np.array([shares[0] if shares else 1.0 for shares in fitting])


def rewards(inputs: RewardInputs, weights: dict[str, float], scales: RewardScales) -> dict[str, jax.Array]:
    """Each weighted term, by name."""
    return {name: weight * TERMS[name](inputs, scales) for name, weight in weights.items()}


def reward_rate(terms: dict[str, jax.Array], scales: RewardScales) -> jax.Array:
    """Reward per second of the weighted terms.

    The sum is clipped from below, lest a clumsy beginner earn most by ending the episode; a fall, which
    happens once and ends it, is counted in full.
    """
    going_on = sum((value for name, value in terms.items() if name != "fall"), start=jnp.float32(0.0))
    return jnp.maximum(going_on, scales.least) + terms.get("fall", 0.0)
