"""A mirrored robot in a mirrored state has mirrored observations and motion."""

from dataclasses import replace

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


@pytest.mark.parametrize("preset", ["smoke", "gpu"])
def test_a_mirrored_state_has_the_mirrored_observation(preset: str) -> None:
    env = LocomotionEnv(ROBOT, replace(load_preset(preset).env, noise=Noise()))
    mirror, seen, seen_mirrored = env.mirror(), observed(env, mirrored=False), observed(env, mirrored=True)
    assert seen.keys() == seen_mirrored.keys() == mirror.observation.keys()
    for name, vector in seen.items():
        assert np.mean(np.abs(vector - seen_mirrored[name]) > 1e-4) > 0.5  # the image differs
        np.testing.assert_allclose(mirror.observation[name](vector), seen_mirrored[name], atol=2e-5)


def observed(env: LocomotionEnv, mirrored: bool) -> dict[str, np.ndarray]:
    """All observations in a random state, or in its mirror image."""
    rng, (state, _) = np.random.default_rng(1), env.reset(jax.random.key(3))

    def normal(*shape: int) -> jax.Array:
        return jnp.asarray(rng.normal(size=shape), dtype=jnp.float32)

    quaternion = normal(4)
    state = state._replace(
        qpos=jnp.concatenate([normal(3), quaternion / jnp.linalg.norm(quaternion), normal(12)]),
        qvel=normal(18),
        command=jnp.array([0.7, 0.3, -0.4]),
        actions=normal(3, 12),
    )
    contact, clearance, torque = normal(4), normal(4), normal(12)
    if mirrored:
        joints, feet, bodies, _ = find_symmetry(env.robot)
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
        state = state._replace(
            sample=sample,
            qpos=state.qpos[order] * np.concatenate([VECTOR, [1.0, -1.0, 1.0, -1.0], joints.sign]),
            qvel=jnp.concatenate(
                [state.qvel[:3] * VECTOR, state.qvel[3:6] * ROTATION, joints(state.qvel[6:])]
            ),
            command=state.command * jnp.array([1.0, -1.0, -1.0]),
            phase=state.phase + 0.5,
            actions=joints(state.actions),
        )
        contact, clearance, torque = contact[feet], clearance[feet], joints(torque)
    recent = jnp.tile(env.observer.readings(state.qpos, state.qvel, torque), (2 * env.config.substeps, 1))
    no_noise = jnp.full(6 + 2 * env.action_size, 0.5)
    state, seen = env.observer.observe(state, recent, no_noise, is_reset=True)
    data = example_data(env.scene)._replace(contact=contact, clearance=clearance, torque=torque)
    _, seen = env.observations(state, seen, env.data_at(state, data))
    return {name: np.asarray(value) for name, value in seen.items()}
