"""A limp robot: after a fall its motors only damp, as on a robot that may not get up yet."""

import jax
import jax.numpy as jnp

from footfall.envs.state import State


def while_limp(
    state: State, action: jax.Array, goal: jax.Array, position: jax.Array
) -> tuple[jax.Array, jax.Array]:
    """The action and the goal that take effect in this control step.

    Args:
        state: before the step.
        action: action of the policy, (n,).
        goal: joint positions that the action commands, rad, (n,).
        position: position of the joints, rad, (n,): a limp robot's goals follow them, and its actions have no
            effect.
    """
    if state.limp_steps is None:
        return action, goal
    limp = state.limp_steps > 0
    return jnp.where(limp, 0.0, action), jnp.where(limp, position, goal)


def stiffness(state: State, kp: jax.Array) -> jax.Array:
    """Stiffness of the motors in this control step, N m/rad, (n,): 0 for a limp robot."""
    return kp if state.limp_steps is None else kp * (state.limp_steps <= 0)


def countdown(state: State) -> State:
    """The state with one limp step less."""
    if state.limp_steps is None:
        return state
    return state._replace(limp_steps=jnp.maximum(state.limp_steps - 1, 0))
