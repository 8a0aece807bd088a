"""Motion of candidates over windows of recordings: a simulator for `identify/shooting.py`, in JAX.

It computes in double precision. The rest of the process must not see that: trainings use single precision.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from footfall.identify.shooting import Number, Simulate

Accelerate = Callable[[Mapping[str, Any], jnp.ndarray, jnp.ndarray], jnp.ndarray]
"""Numbers by name, state (q, v) of (2 n,) and what the motors get, (u,): accelerations (n,)."""

MOST_RAD_S = 60.0  # keeps a bad candidate finite


class Inputs(NamedTuple):
    """What the motors got over W windows, on the physics grid, and when readings were taken."""

    given: np.ndarray  # (W, M + S, u) from M steps before the start on
    margin: int  # M, the longest delay
    step_s: float
    read: np.ndarray  # (W, R) steps from the start, not whole


def delayed(given: jnp.ndarray, delay: jnp.ndarray) -> jnp.ndarray:
    """A column (T,) that takes effect later by a number of steps, which need not be whole."""
    at = jnp.arange(given.shape[0], dtype=float)
    return jnp.interp(at - delay, at, given)


def rollouts(
    accelerate: Accelerate,
    inputs: Inputs,
    numbers: Sequence[Number],
    delays: Sequence[str | None] = (),
    scales: Sequence[str | None] = (),
) -> Simulate:
    """Semi-implicit Euler over all windows and candidates.

    Args:
        accelerate: of one window of one candidate.
        inputs: of the windows.
        numbers: that candidates have.
        delays: name of the number that delays each input, s; None or absent for none.
        scales: likewise of a factor of each input.
    """
    names = [each.name for each in numbers]
    with jax.enable_x64(True):
        given, read = jnp.asarray(inputs.given), jnp.asarray(inputs.read)
        before = jnp.floor(read).astype(int).clip(0, given.shape[1] - inputs.margin - 1)
        share = read - before
        windows = jnp.arange(given.shape[0])

    def one(number: jnp.ndarray, start: jnp.ndarray, window: jnp.ndarray) -> jnp.ndarray:
        value = dict(zip(names, number, strict=True))
        columns = []
        for column in range(given.shape[2]):
            mine = given[window, :, column]
            delay = delays[column] if column < len(delays) else None
            scale = scales[column] if column < len(scales) else None
            if delay in value:
                mine = delayed(mine, value[delay] / inputs.step_s)
            columns.append(mine * value[scale] if scale in value else mine)
        drive = jnp.stack(columns, axis=-1)[inputs.margin :]
        n = start.shape[0] // 2

        def step(state: jnp.ndarray, drive: jnp.ndarray) -> tuple[jnp.ndarray, jnp.ndarray]:
            speed = state[n:] + inputs.step_s * accelerate(value, state, drive)
            speed = jnp.clip(speed, -MOST_RAD_S, MOST_RAD_S)
            after = jnp.concatenate([state[:n] + inputs.step_s * speed, speed])
            return after, after[:n]

        _, path = jax.lax.scan(step, start, drive)
        path = jnp.concatenate([start[None, :n], path])
        low, high = path[before[window]], path[before[window] + 1]
        return low + share[window][:, None] * (high - low)

    every = jax.jit(jax.vmap(jax.vmap(one, (None, 0, 0)), (1, 0, None)))

    def simulate(numbers: np.ndarray, start: np.ndarray) -> np.ndarray:
        with jax.enable_x64(True):
            return np.asarray(every(jnp.asarray(numbers), jnp.asarray(start), windows))

    return simulate
