"""Many episodes at once; where one ends, the next begins."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp

from footfall.envs.environment import Episodes
from footfall.envs.state import State, Step

RESTARTS_PER_PASS = 16  # a larger number wastes work when few episodes end, a smaller one loops when many do

Restarted = tuple[State, dict[str, jax.Array]]  # state, and the observations for the next actions


def step_batch(env: Episodes, state: State, action: jax.Array) -> tuple[State, dict[str, jax.Array], Step]:
    """One control step of every episode.

    Args:
        state: a batch of states, as from `jax.vmap(env.reset)`.
        action: shape (environments, n).

    Returns:
        State and observation for the next action (of a new episode where one ended), and the result of the
        step itself. Its metrics also have "done", and the "length" of ended episodes in steps.
    """
    with jax.default_matmul_precision("highest"):
        stepped, step = jax.vmap(env.step)(state, action)
    done = jnp.maximum(step.terminated, step.truncated)
    episode_metrics = {"done": done, "length": done * stepped.steps}
    current = stepped, step.observation
    if env.on_host:  # branches are cheap on the host, and few episodes end at once
        state, observation = _restart_in_passes(env, done > 0, current)
    else:
        state, observation = _select(done, jax.vmap(restart_of(env))(stepped), current)
    return state, observation, step._replace(metrics=step.metrics | episode_metrics)


def restart_of(env: Episodes) -> Callable[[State], Restarted]:
    """Returns the function that begins the next episode from an episode's last state."""
    return getattr(env, "restart", lambda state: env.reset(state.key, state.level))


def _restart_in_passes(env: Episodes, done: jax.Array, current: Restarted) -> Restarted:
    """New episodes where `done` (environments,) holds, in passes of RESTARTS_PER_PASS episodes."""
    count, (stepped, _) = len(done), current
    rows_per_pass = min(count, RESTARTS_PER_PASS)

    def restart_rows(carry: tuple[jax.Array, Restarted]) -> tuple[jax.Array, Restarted]:
        done, batch = carry
        (rows,) = jnp.nonzero(done, size=rows_per_pass, fill_value=count)  # rows past the last are dropped
        new = jax.vmap(restart_of(env))(jax.tree.map(lambda x: x[rows], stepped))
        batch = jax.tree.map(lambda old, new: old.at[rows].set(new, mode="drop"), batch, new)
        return done.at[rows].set(False, mode="drop"), batch

    return jax.lax.while_loop(lambda carry: jnp.any(carry[0]), restart_rows, (done, current))[1]


def _select(condition: jax.Array, yes: Any, no: Any) -> Any:
    """`yes` where the condition (environments,) holds, else `no`, leaf by leaf."""

    def choose(a: jax.Array, b: jax.Array) -> jax.Array:
        return jnp.where(condition.reshape((-1,) + (1,) * (a.ndim - 1)) > 0, a, b)

    return jax.tree.map(choose, yes, no)
