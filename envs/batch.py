"""Many episodes at once; where one ends, the next begins."""

from typing import Any

import jax
import jax.numpy as jnp

from envs.velocity import State, Step, VelocityEnv


def step_batch(env: VelocityEnv, state: State, action: jax.Array) -> tuple[State, dict[str, jax.Array], Step]:
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

    def restart() -> Any:
        return _select(done, jax.vmap(env.reset)(stepped.key, stepped.level), going_on)

    if env.config.physics == "c":  # the host is at hand to ask whether any has ended; most often none has
        state, observation = jax.lax.cond(jnp.any(done > 0), restart, lambda: going_on)
    else:
        state, observation = restart()
    return state, observation, step._replace(metrics=step.metrics | ended)


def _select(condition: jax.Array, yes: Any, no: Any) -> Any:
    """`yes` where the condition (environments,) holds, else `no`, leaf by leaf."""

    def choose(a: jax.Array, b: jax.Array) -> jax.Array:
        return jnp.where(condition.reshape((-1,) + (1,) * (a.ndim - 1)) > 0, a, b)

    return jax.tree.map(choose, yes, no)
