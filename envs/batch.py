"""Many episodes at once; where one ends, the next begins."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from footfall.envs.environment import Episodes
from footfall.envs.state import State, Step

RESTARTED_AT_ONCE = 16  # more wastes work when few episodes end, fewer loops more often when many do

Restarted = tuple[State, dict[str, jax.Array]]  # and the observations to go on with


def step_batch(env: Episodes, state: State, action: jax.Array) -> tuple[State, dict[str, jax.Array], Step]:
    """One control step of every episode.

    Args:
        state: a batch of states, as from `jax.vmap(env.reset)`.
        action: shape (environments, n).

    Returns:
        State and observation to go on with, which are a new episode's where one ended, and what the step
        itself gave. Its metrics say besides which episodes are "done", and after what "length" in steps.
    """
    with jax.default_matmul_precision("highest"):
        stepped, step = jax.vmap(env.step)(state, action)
    done = jnp.maximum(step.terminated, step.truncated)
    ended = {"done": done, "length": done * stepped.steps}
    going_on = stepped, step.observation
    if env.on_host:  # it is at hand to ask how many have ended; most often few have
        state, observation = _restart_few(env, done > 0, going_on)
    else:
        state, observation = _select(done, jax.vmap(restart_of(env))(stepped), going_on)
    return state, observation, step._replace(metrics=step.metrics | ended)


def restart_of(env: Episodes) -> Callable[[State], Restarted]:
    """Makes the episode after one that ended in a state."""
    return getattr(env, "restart", lambda state: env.reset(state.key, state.level))


def _restart_few(env: Episodes, done: jax.Array, going_on: Restarted) -> Restarted:
    """New episodes where `done` (environments,) holds, a few at a time until there are no more."""
    count, (stepped, _) = len(done), going_on
    at_once = min(count, RESTARTED_AT_ONCE)

    def restart(left: tuple[jax.Array, Restarted]) -> tuple[jax.Array, Restarted]:
        done, batch = left
        (rows,) = jnp.nonzero(done, size=at_once, fill_value=count)  # a row past the last is no one's
        new = jax.vmap(restart_of(env))(jax.tree.map(lambda x: x[rows], stepped))
        batch = jax.tree.map(lambda old, new: old.at[rows].set(new, mode="drop"), batch, new)
        return done.at[rows].set(False, mode="drop"), batch

    return jax.lax.while_loop(lambda left: jnp.any(left[0]), restart, (done, going_on))[1]


def _select(condition: jax.Array, yes: Any, no: Any) -> Any:
    """`yes` where the condition (environments,) holds, else `no`, leaf by leaf."""

    def choose(a: jax.Array, b: jax.Array) -> jax.Array:
        return jnp.where(condition.reshape((-1,) + (1,) * (a.ndim - 1)) > 0, a, b)

    return jax.tree.map(choose, yes, no)
