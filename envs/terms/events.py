"""Event terms: changes to the robot from outside, at each reset or at random intervals.

Differences between robots for a whole episode (masses, friction, delays, biases) belong to the section
`randomisation`, whose quantities also act on the simulated robot of an evaluation (domain_rand/).
"""

from collections.abc import Callable
from typing import Annotated, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.limits import MAX_COMMAND
from footfall.common.rotations import multiply, normalised, random_rotation
from footfall.common.terms import Between
from footfall.domain_rand.distributions import Distribution
from footfall.envs.physics.interface import GRAVITY
from footfall.envs.state import State
from footfall.envs.terms.data import Scene
from footfall.robots.kinds import Parts

Amplitude = Annotated[float, Between(0.0, MAX_COMMAND)]  # half-width of a uniform range, or the largest value


class Occasion(NamedTuple):
    """Inputs of an event besides the state."""

    scene: Scene
    due: jax.Array | bool  # whether the changed state will be used
    u: jax.Array  # uniform numbers in [0, 1), as many as the term declares
    strength: jax.Array | float  # share of the full strength, from the curriculum, 0 to 1


class EventTerm(NamedTuple):
    """The declaration of an event."""

    change: Callable[..., State]  # from a state and an `Occasion` to the state after the event
    numbers: Callable[[Parts], int]  # uniform numbers that it takes, on a given robot
    interval_s: Distribution | None  # between two events; None: at each reset
    reads_due: bool  # the function itself reads `due`: selecting the state again would cost 5 %
    generated_only: bool  # needs the generated physics


def event_term(
    numbers: int | Callable[[Parts], int] = 0,
    interval_s: Distribution | None = None,
    reads_due: bool = False,
    generated_only: bool = False,
) -> Callable[[Callable[..., State]], EventTerm]:
    """Decorator of a function of a state and an `Occasion` that returns the changed state."""
    count = numbers if callable(numbers) else lambda _: numbers
    return lambda change: EventTerm(change, count, interval_s, reads_due, generated_only)


def scattered(values: jax.Array, indices: np.ndarray, vector: jax.Array) -> jax.Array:
    """The vector with these values at these indices, by a gather: a GPU fuses a gather, but no scatter."""
    source = np.full(vector.shape, len(values))
    source[indices] = np.arange(len(values))
    return jnp.where(source < len(values), jnp.append(values, 0.0)[source], vector)


@event_term(numbers=lambda parts: 6 + 1 + 2 * parts.joints)
def reset_pose(
    state: State,
    occasion: Occasion,
    *,
    joint_rad: Amplitude = 0.1,
    tilt_rad: Amplitude = 0.1,
    velocity_m_s: Amplitude = 0.3,
    yaw_rate_rad_s: Amplitude = 0.3,
    joint_velocity_rad_s: Amplitude = 0.5,
) -> State:
    """Begin near the default pose, on the feet, at any heading.

    The parameters are half-widths of uniform offsets from standing still.
    """
    scene, u = occasion.scene, 2 * occasion.u - 1
    n = len(scene.robot.joint_names)
    yaw = jnp.pi * u[0]
    tilt = tilt_rad * u[1:3]
    quaternion = multiply(
        jnp.array([jnp.cos(yaw / 2), 0.0, 0.0, jnp.sin(yaw / 2)]),
        normalised(jnp.array([1.0, tilt[0] / 2, tilt[1] / 2, 0.0])),
    )
    qpos = scene.base.turned(state.qpos, quaternion)
    qpos = qpos + scattered(joint_rad * u[7 : 7 + n], scene.positions, jnp.zeros_like(qpos))
    qvel = scene.base.moving(state.qvel, velocity_m_s * u[3:5], yaw_rate_rad_s * u[5])
    qvel = scattered(joint_velocity_rad_s * u[7 + n :], scene.dofs, qvel)
    return state._replace(qpos=qpos, qvel=qvel)


@event_term(numbers=lambda parts: 3 + 1 + 6 + 2 * parts.joints + 1)
def drop(
    state: State,
    occasion: Occasion,
    *,
    lowest_m: Amplitude = 0.05,
    highest_m: Amplitude = 0.3,
    velocity_m_s: Amplitude = 0.5,
    angular_rad_s: Amplitude = 1.0,
    joint_velocity_rad_s: Amplitude = 2.0,
    limp_s: Annotated[float, Between(0.0, 10.0)] = 0.0,
) -> State:
    """Begin in any attitude with any joint positions inside the soft limits, and fall.

    The motors hold the pose at first, or only damp for up to `limp_s`: then limbs may end up folded under the
    trunk and pressed on each other. The first two parameters are the range of the height of the lowest point
    of trunk and limbs, feet not counted; the next three are half-widths of uniform velocities.
    """
    scene, u = occasion.scene, occasion.u
    n = len(scene.robot.joint_names)
    pose = scene.soft_lower + (scene.soft_upper - scene.soft_lower) * u[10 : 10 + n]
    qpos = scene.base.turned(state.qpos, random_rotation(u[:3]))
    qpos = scattered(pose, scene.positions, qpos)
    lift = (
        lowest_m + (highest_m - lowest_m) * u[3] - jnp.min(scene.body.points(qpos)[:, 2] - scene.body.radius)
    )
    qpos = scene.base.shifted(qpos, jnp.array([0.0, 0.0, 1.0]) * lift)
    half_widths = jnp.array([velocity_m_s] * 3 + [angular_rad_s] * 3)
    qvel = scene.base.pushed(state.qvel, half_widths * (2 * u[4:10] - 1))
    qvel = scattered(joint_velocity_rad_s * (2 * u[10 + n : 10 + 2 * n] - 1), scene.dofs, qvel)
    goals = jnp.tile(pose, (len(state.goals), 1))
    limp_steps = jnp.int32(u[10 + 2 * n] * limp_s / scene.period_s) if limp_s else None
    return state._replace(qpos=qpos, qvel=qvel, target=pose, goals=goals, limp_steps=limp_steps)


@event_term(numbers=2, generated_only=True)
def slope(
    state: State, occasion: Occasion, *, up_to_rad: Annotated[float, Between(0.0, 0.8)] = 0.26
) -> State:
    """Slope the ground in a random direction, by a uniform angle up to `up_to_rad`.

    The simulated ground stays level and gravity is tilted. Rewards and terminations refer to the slope, the
    sensors to gravity.
    """
    slope_rad, direction_rad = up_to_rad * occasion.u[0], 2.0 * jnp.pi * occasion.u[1]
    horizontal = jnp.sin(slope_rad)
    down = jnp.stack(
        [horizontal * jnp.cos(direction_rad), horizontal * jnp.sin(direction_rad), -jnp.cos(slope_rad)]
    )
    return state._replace(fields=state.fields | {GRAVITY: GRAVITY_M_S2 * down})


@event_term(generated_only=True)
def gravity(state: State, occasion: Occasion) -> State:
    """Gravity at the share of its strength that a curriculum gives: a robot that is lighter at first."""
    full = state.fields.get(GRAVITY, jnp.array([0.0, 0.0, -GRAVITY_M_S2]))
    return state._replace(fields=state.fields | {GRAVITY: occasion.strength * full})


@event_term(numbers=1)
def begin_late(
    state: State, occasion: Occasion, *, up_to_s: Annotated[float, Between(0.0, 100.0)] = 2.0
) -> State:
    """Shorten an episode by up to `up_to_s`, so that the time limits of episodes do not coincide."""
    return state._replace(steps=jnp.int32(occasion.u[0] * up_to_s / occasion.scene.period_s))


@event_term(numbers=6, interval_s=Distribution(2.0, 6.0), reads_due=True)
def push(
    state: State,
    occasion: Occasion,
    *,
    horizontal_m_s: Amplitude = 0.0,
    vertical_m_s: Amplitude = 0.0,
    angular_rad_s: Amplitude = 0.0,
) -> State:
    """Push: a sudden change of the base's velocity, up to these values, in a random direction."""
    u = occasion.u
    angle, size = 2 * jnp.pi * u[0], horizontal_m_s * u[1]
    linear = jnp.array([size * jnp.cos(angle), size * jnp.sin(angle), vertical_m_s * (2 * u[2] - 1)])
    change = occasion.strength * jnp.concatenate([linear, angular_rad_s * (2 * u[3:] - 1)])
    # Selected before the addition: otherwise product and sum may be fused, and runs would not repeat.
    change = jnp.where(occasion.due, change, 0.0)
    return state._replace(qvel=occasion.scene.base.pushed(state.qvel, change))


EVENTS: dict[str, EventTerm] = {
    "reset_pose": reset_pose,
    "drop": drop,
    "slope": slope,
    "gravity": gravity,
    "begin_late": begin_late,
    "push": push,
}
