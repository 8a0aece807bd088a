"""Delays in continuous time between control steps: none is rounded to physics steps."""

import jax
import jax.numpy as jnp
import numpy as np


def delayed_goals(
    goals: jax.Array, delay_s: jax.Array | None, starts_s: np.ndarray, timestep_s: float, period_s: float
) -> jax.Array:
    """The joint target that has reached the motors, as its mean over each physics step.

    A target that arrives within a step counts for the share of the step that is left. The motors' law is
    linear in the target, so the step gets the impulse that it would get in continuous time.

    Args:
        goals: targets of the last control steps, newest first, shape (k, n).
        delay_s: action delay, at most (k - 1) control periods; None: no delay. Shape () for all, or (k, n)
            for each goal to each joint: a goal arrives with the next one at the latest.
        starts_s: when each physics step begins, after the newest target was computed, shape (s,).
        timestep_s: length of a physics step.
        period_s: control period.

    Returns:
        Targets, shape (s, n).
    """
    if delay_s is None:
        return jnp.broadcast_to(goals[0], (len(starts_s), goals.shape[-1]))
    pending = goals.shape[0] - 1  # number of goals that may not have arrived: all except the oldest
    ages_s = period_s * np.arange(pending)
    # Time from an undelayed arrival to the end of each step.
    until_end_s = (starts_s + timestep_s)[:, None] + ages_s
    if jnp.ndim(delay_s):
        arrived_share = jnp.clip((until_end_s[:, :, None] - delay_s[:-1]) / timestep_s, 0.0, 1.0)
        arrived_share = jax.lax.cummax(arrived_share, axis=1)
    else:
        arrived_share = jnp.clip((until_end_s - delay_s) / timestep_s, 0.0, 1.0)[:, :, None]
    changes = goals[:-1] - goals[1:]
    return goals[-1] + sum(arrived_share[:, k] * changes[k] for k in range(pending))


def delayed_readings(recent: jax.Array, delay_s: jax.Array | None, timestep_s: float) -> jax.Array:
    """Readings as they were `delay_s` ago, by linear interpolation between physics steps.

    Args:
        recent: readings after each of the last physics steps, oldest first, shape (k, m).
        delay_s: observation delay, at most (k - 1) physics steps; None: no delay. Shape () for all, or (m,)
            for each number.
        timestep_s: physics step.
    """
    if delay_s is None:
        return recent[-1]
    row = jnp.clip(recent.shape[0] - 1 - delay_s / timestep_s, 0.0, recent.shape[0] - 1.0)
    before = jnp.floor(row).astype(jnp.int32)
    after = jnp.minimum(before + 1, recent.shape[0] - 1)
    weight = row - before
    column = jnp.arange(recent.shape[1]) if jnp.ndim(delay_s) else slice(None)
    return (1.0 - weight) * recent[before, column] + weight * recent[after, column]
