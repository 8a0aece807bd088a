"""Motion of candidates in windows of recordings: a simulator for `identify/shooting.py`, in JAX.

It uses float64 in its own context: training in the same process stays in float32.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from footfall.identify.shooting import FitParameter, Simulate

Acceleration = Callable[[Mapping[str, Any], jnp.ndarray, jnp.ndarray], jnp.ndarray]
"""Parameters by name, state (q, v) of (2 n,) and motor inputs, (u,): accelerations (n,)."""

MAX_RAD_S = 60.0  # clip on joint speeds, so that a bad candidate stays finite


class Inputs(NamedTuple):
    """Inputs of the motors over W windows, by physics step, and the times of readings."""

    values: np.ndarray  # (W, M + S, u) inputs from M steps before the start on
    margin: int  # M, the longest delay, steps
    step_s: float
    read: np.ndarray  # (W, R) times of readings, steps from the start, fractional


def delayed(values: jnp.ndarray, delay: jnp.ndarray) -> jnp.ndarray:
    """An input (T,) delayed by a number of steps, which may be fractional."""
    at = jnp.arange(values.shape[0], dtype=float)
    return jnp.interp(at - delay, at, values)


def rollouts(
    acceleration: Acceleration,
    inputs: Inputs,
    parameters: Sequence[FitParameter],
    delays: Sequence[str | None] = (),
    scales: Sequence[str | None] = (),
) -> Simulate:
    """Semi-implicit Euler over all windows and candidates.

    Args:
        acceleration: accelerations in one window of one candidate.
        inputs: inputs of all windows.
        parameters: the parameters of a candidate.
        delays: name of the parameter that delays each input, s; None or absent for none.
        scales: name of the parameter that scales each input; None or absent for none.
    """
    names = [each.name for each in parameters]
    with jax.enable_x64(True):
        values, read = jnp.asarray(inputs.values), jnp.asarray(inputs.read)
        index_before = jnp.floor(read).astype(int).clip(0, values.shape[1] - inputs.margin - 1)
        share = read - index_before
        windows = jnp.arange(values.shape[0])

    def simulate_window(candidate: jnp.ndarray, start: jnp.ndarray, window: jnp.ndarray) -> jnp.ndarray:
        by_name = dict(zip(names, candidate, strict=True))
        columns = []
        for column in range(values.shape[2]):
            column_values = values[window, :, column]
            delay = delays[column] if column < len(delays) else None
            scale = scales[column] if column < len(scales) else None
            if delay in by_name:
                column_values = delayed(column_values, by_name[delay] / inputs.step_s)
            columns.append(column_values * by_name[scale] if scale in by_name else column_values)
        drive = jnp.stack(columns, axis=-1)[inputs.margin :]
        n = start.shape[0] // 2

        def step(state: jnp.ndarray, drive: jnp.ndarray) -> tuple[jnp.ndarray, jnp.ndarray]:
            speed = state[n:] + inputs.step_s * acceleration(by_name, state, drive)
            speed = jnp.clip(speed, -MAX_RAD_S, MAX_RAD_S)
            after = jnp.concatenate([state[:n] + inputs.step_s * speed, speed])
            return after, after[:n]

        _, path = jax.lax.scan(step, start, drive)
        path = jnp.concatenate([start[None, :n], path])
        low, high = path[index_before[window]], path[index_before[window] + 1]
        return low + share[window][:, None] * (high - low)

    simulate_windows = jax.jit(jax.vmap(jax.vmap(simulate_window, (None, 0, 0)), (1, 0, None)))

    def simulate(candidates: np.ndarray, start: np.ndarray) -> np.ndarray:
        with jax.enable_x64(True):
            return np.asarray(simulate_windows(jnp.asarray(candidates), jnp.asarray(start), windows))

    return simulate
