"""A mirrored robot in a mirrored state has mirrored observations and motion."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from footfall.domain_rand.noise import Noise
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.terms.data import example_data
from footfall.robots.description import load_robot
from footfall.robots.symmetry import ROTATION, VECTOR, find_symmetry
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
QUIET = Noise()


@cache
def quiet(preset: str) -> LocomotionEnv:
    return LocomotionEnv(ROBOT, replace(load_preset(preset).env, noise=QUIET))


@pytest.mark.parametrize("preset", ["smoke", "gpu"])
def test_a_mirrored_state_has_the_mirrored_observation(preset: str) -> None:
    env = quiet(preset)
    mirror = env.mirror()
    seen = _observed(env, mirrored=False)
    seen_mirrored = _observed(env, mirrored=True)
    assert seen.keys() == seen_mirrored.keys() == mirror.observation.keys()
    for name, vector in seen.items():
        assert np.mean(np.abs(vector - seen_mirrored[name]) > 1e-4) > 0.5  # the image differs
        np.testing.assert_allclose(mirror.observation[name](vector), seen_mirrored[name], atol=2e-5)


def _observed(env: LocomotionEnv, mirrored: bool) -> dict[str, np.ndarray]:
    """All observations in a random state, or in its mirror image."""
    state, contact, clearance, torque = _random_state(env)
    joints, feet, bodies, _ = find_symmetry(env.robot)
    if mirrored:
        sign = {"com_offset_m": VECTOR, "gravity_bias": VECTOR, "gyro_bias": ROTATION}
        sample = {}
        for name, value in state.sample.items():
            if value.ndim == 0:
                sample[name] = value
            elif name in sign:
                sample[name] = value * sign[name]
            elif value.shape == (13,):
                sample[name] = value[bodies]
            else:
                sample[name] = joints(value) if name == "encoder_bias" else value[joints.source]
        order = np.concatenate([np.arange(7), 7 + joints.source])
        qpos = state.qpos[order] * np.concatenate([VECTOR, [1.0, -1.0, 1.0, -1.0], joints.sign])
        qvel = jnp.concatenate([state.qvel[:3] * VECTOR, state.qvel[3:6] * ROTATION, joints(state.qvel[6:])])
        state = state._replace(
            sample=sample,
            qpos=qpos,
            qvel=qvel,
            command=state.command * jnp.array([1.0, -1.0, -1.0]),
            phase=state.phase + 0.5,
            actions=joints(state.actions),
        )
        torque = joints(torque)
        contact, clearance = contact[feet], clearance[feet]
    clean = jnp.concatenate([state.qvel[3:6], -_up(state.qpos[3:7]), state.qpos[7:], state.qvel[6:]])
    recent = jnp.tile(clean, (2 * env.config.substeps, 1))
    no_noise = jnp.full(6 + 2 * env.action_size, 0.5)
    state, observed = env.observer.observe(state, recent, no_noise, is_reset=True)
    data = example_data(env.scene)._replace(contact=contact, clearance=clearance, torque=torque)
    _, seen = env.observations(state, observed, env.data_at(state, data))
    return {name: np.asarray(value) for name, value in seen.items()}


def _up(q: jax.Array) -> jax.Array:
    w, x, y, z = q
    return jnp.array([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])


def _random_state(env: LocomotionEnv) -> tuple:
    state, _ = env.reset(jax.random.key(3))
    rng = np.random.default_rng(1)

    def normal(*shape: int) -> jax.Array:
        return jnp.asarray(rng.normal(size=shape), dtype=jnp.float32)

    quaternion = normal(4)
    state = state._replace(
        qpos=jnp.concatenate([normal(3), quaternion / jnp.linalg.norm(quaternion), normal(12)]),
        qvel=normal(18),
        command=jnp.array([0.7, 0.3, -0.4]),
        actions=normal(3, 12),
    )
    return state, normal(4), normal(4), normal(12)
