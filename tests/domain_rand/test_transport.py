"""Jitter, swings and lost frames change when commands and readings arrive, and by how much."""

from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from footfall.deploy.config import DeployConfig
from footfall.deploy.frames import Frames
from footfall.domain_rand.sample import Sample
from footfall.domain_rand.transport import (
    FRAME_PERIOD_S,
    SWING_PERIOD_S,
    Transport,
    delay_now_s,
    transport_of,
    waiting_s,
)
from footfall.envs.lateness import Lateness
from footfall.plant.delays import Delay, DelayLine, Losses

PERIOD_S, N = 0.02, 12


def drawn(sample: Sample, seed: int, time_s: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Delay of a new goal (N,) and of the readings (numbers,) in training, s."""
    lateness, key = Lateness(N, PERIOD_S), jax.random.PRNGKey(seed)
    in_jax = {name: jnp.float32(value) for name, value in sample.items()}
    steps, initial = jnp.int32(round(time_s / PERIOD_S)), lateness.initial(in_jax)
    state = SimpleNamespace(sample=in_jax, key=key, steps=steps, lateness_s=initial)
    found = lateness.of_goals(state), lateness.of_readings(state, key)  # type: ignore[arg-type]
    goals, readings = (np.zeros(0) if each is None else np.asarray(each) for each in found)
    return goals, readings


def test_a_frame_takes_as_long_in_training_as_in_the_loop() -> None:
    assert DeployConfig().tick_us * 1e-6 == FRAME_PERIOD_S


@pytest.mark.parametrize(("time_s", "share"), [(0.0, 0.0), (0.5, 0.25), (2.0, 1.0), (3.0, 0.5), (4.0, 0.0)])
def test_a_swing_rises_and_falls(time_s: float, share: float) -> None:
    transport = Transport(delay_s=0.003, swing_s=0.008)
    assert delay_now_s(transport, time_s * SWING_PERIOD_S / 4.0, 0.9) == pytest.approx(0.003 + 0.008 * share)


def test_frames_are_lost_in_a_row_as_often_as_by_chance() -> None:
    u = np.random.default_rng(0).random(20_000)
    frames = waiting_s(np.float64(0.3), u) / FRAME_PERIOD_S
    for k in range(4):
        assert (frames > k - 0.5).mean() == pytest.approx(0.3**k, abs=0.01)
    assert not waiting_s(np.float64(0.0), u).any()


def test_without_changes_nothing_is_drawn_in_training() -> None:
    for sample in ({}, {"action_delay_s": 0.01, "observation_delay_s": 0.01}):
        assert [each.size for each in drawn(sample, 0)] == [0, 0]


def test_jitter_is_drawn_once_a_step_for_all_motors() -> None:
    sample = {"action_delay_s": 0.004, "action_jitter_s": 0.01}
    delays = np.array([drawn(sample, k)[0][0] for k in range(40)])
    assert (np.ptp(delays, axis=1) == 0.0).all()
    assert 0.004 <= delays.min() < 0.006
    assert 0.012 < delays.max() <= 0.014


def test_a_goal_keeps_its_delay_while_it_is_on_its_way() -> None:
    sample, initial = {"action_jitter_s": jnp.float32(0.01)}, jnp.arange(3.0)[:, None] * jnp.ones(N)
    state = SimpleNamespace(sample=sample, key=jax.random.PRNGKey(0), steps=jnp.int32(0), lateness_s=initial)
    after = Lateness(N, PERIOD_S).of_goals(state)  # type: ignore[arg-type]
    assert after is not None
    np.testing.assert_array_equal(after[1:], initial[:2])


@pytest.mark.parametrize("seed", range(5))
def test_a_motors_readings_are_lost_together_others_by_themselves(seed: int) -> None:
    frames = drawn({"lost_replies": 0.6}, seed)[1] / FRAME_PERIOD_S
    np.testing.assert_allclose(frames, np.rint(frames), atol=1e-5)
    assert frames.shape == (6 + 2 * N,)
    gyro, gravity, positions, velocities = np.split(frames, [3, 6, 6 + N])
    np.testing.assert_array_equal(positions, velocities)
    assert np.ptp(positions) > 0.0
    assert np.ptp(gyro) == np.ptp(gravity) == 0.0


def test_commands_are_lost_for_each_motor_by_itself() -> None:
    frames = np.concatenate([drawn({"lost_commands": 0.3}, k)[0][0] for k in range(60)]) / FRAME_PERIOD_S
    assert (frames > 0.5).mean() == pytest.approx(0.3, abs=0.06)
    assert frames.mean() == pytest.approx(0.3 / 0.7, abs=0.1)


def test_a_swing_follows_the_episodes_time() -> None:
    found = [drawn({"observation_swing_s": 0.01}, 0, time_s)[1][0] for time_s in (0.0, 1.0, 2.0)]
    np.testing.assert_allclose(found, [0.0, 0.005, 0.01], atol=1e-6)


@pytest.mark.parametrize(("direction", "name"), [("actions", "action"), ("readings", "observation")])
def test_delays_on_the_plant_are_those_of_training_in_whole_steps(direction: Any, name: str) -> None:
    sample = {f"{name}_{part}_s": np.array(0.01) for part in ("delay", "jitter", "swing")}
    delay = Delay(sample, direction, 0.001, seed=1)
    steps = np.array([delay.steps(step) for step in range(4000)])
    jitter = steps - 10.0 - 10.0 * (1.0 - abs(1.0 - np.arange(4000) / 2000.0))
    assert -0.6 < jitter.min() < jitter.max() < 10.6
    assert jitter.reshape(-1, 20).std(axis=1).max() < 0.6  # for 20 ms each
    assert jitter.reshape(-1, 20).mean(axis=1).std() == pytest.approx(10.0 / 12**0.5, rel=0.15)


def test_readings_never_go_back_in_time() -> None:
    delay_line: DelayLine[int] = DelayLine({"observation_jitter_s": np.array(0.015)}, 0.001, seed=2)
    seen = []
    for step in range(400):
        delay_line.push(step)
        seen.append(delay_line.delayed())
    late = np.arange(400) - np.array(seen)
    assert (np.diff(seen) >= 0).all()
    assert late.min() <= 1
    assert 13 <= late.max() <= 15


def test_each_frame_is_lost_by_itself() -> None:
    frames = Frames(np.zeros(12, int), np.arange(12), np.zeros((12, 8), np.uint8), np.full(12, 8))
    losses = Losses({"lost_commands": np.array(0.3)}, "actions", seed=3)
    left = np.concatenate([losses.pass_on(frames).id for _ in range(500)])
    np.testing.assert_allclose(np.bincount(left) / 500, 0.7, atol=0.08)
    readings = Losses({"lost_commands": np.array(0.3)}, "readings", seed=3)
    assert readings.share == 0.0
    np.testing.assert_array_equal(readings.pass_on(frames).id, frames.id)


def test_transport_of_one_direction_collects_its_quantities() -> None:
    values = {"action_delay_s": 0.004, "action_jitter_s": 0.01, "action_swing_s": 0.006, "lost_commands": 0.3}
    sample = {name: np.array(value) for name, value in values.items()}
    assert transport_of(sample, "actions") == tuple(values.values())
    assert not transport_of(sample, "readings").varies
