"""The height scans of the simulated robot: delayed, at their own rate, and with a real robot's errors."""

import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from footfall.common.rotations import heading
from footfall.domain_rand.height_scan import (
    NUMBERS,
    EpisodeErrors,
    HeightScanErrors,
    draw_errors,
    with_errors,
)
from footfall.envs.base import Base
from footfall.envs.random_numbers import split
from footfall.envs.state import State
from footfall.policies.height_scan import HEIGHT_SCAN, HeightScan

DUE_TOLERANCE_S = 1e-4  # of a scan's time, which is a sum of rounded numbers

Heights = Callable[[jax.Array], jax.Array]  # from positions (..., 2) in the world to the ground's height, m


class Scans(NamedTuple):
    """State of an episode's scans."""

    poses: jax.Array  # (kept, 4) x, y, z m and yaw rad of the base after the last control steps, newest first
    errors: EpisodeErrors


class Scanner:
    """Takes the height scans of one robot; holds constants only."""

    def __init__(self, scan: HeightScan, errors: HeightScanErrors, base: Base, period_s: float) -> None:
        self._scan, self._errors, self._base, self._period_s = scan, errors, base, period_s
        self._kept = math.ceil((errors.lag_s[1] + 1.0 / scan.rate_hz) / period_s) + 1
        self.numbers = NUMBERS + 2 * scan.size  # uniform numbers that `deliver` takes

    def deliver(self, state: State, ground: Heights, u: jax.Array, is_reset: bool) -> tuple[State, jax.Array]:
        """The newest heights that have arrived, (points,), NaN if unknown; to be called once a control step.

        Args:
            state: after the control step.
            ground: heights of the ground around the robot.
            u: uniform numbers, (numbers,).
            is_reset: whether an episode begins.
        """
        u_errors, u_noise = split(u, NUMBERS, 2 * self._scan.size)
        pose, time_s = self._pose(state), state.steps * self._period_s
        if is_reset:
            scans = Scans(jnp.tile(pose, (self._kept, 1)), draw_errors(self._errors, u_errors))
        else:
            previous: Scans = state.terms[HEIGHT_SCAN][HEIGHT_SCAN]
            scans = previous._replace(poses=jnp.concatenate([pose[None], previous.poses[:-1]]))
        rate_hz, episode_errors = self._scan.rate_hz, scans.errors
        taken_s = jnp.floor((time_s - episode_errors.lag_s + DUE_TOLERANCE_S) * rate_hz) / rate_hz
        steps_ago = jnp.round((time_s - taken_s) / self._period_s).astype(jnp.int32)
        pose = scans.poses[jnp.clip(steps_ago, 0, self._kept - 1)]
        heights = self._heights(pose, ground, episode_errors.shift_m)
        heights = with_errors(heights, self._errors, episode_errors, taken_s, u_noise.reshape(2, -1))
        return state._replace(terms=state.terms | {HEIGHT_SCAN: {HEIGHT_SCAN: scans}}), heights

    def exact(self, state: State, ground: Heights) -> jax.Array:
        """The heights without errors and delay, (points,)."""
        return self._heights(self._pose(state), ground, jnp.zeros(2))

    def _pose(self, state: State) -> jax.Array:
        yaw = heading(self._base.quaternion(state.qpos))
        return jnp.append(self._base.position(state.qpos), yaw)

    def _heights(self, pose: jax.Array, ground: Heights, shift: jax.Array) -> jax.Array:
        return ground(self._scan.positions(pose[:3], pose[3], shift)) - pose[2]
