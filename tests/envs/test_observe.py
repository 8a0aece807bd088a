"""What the actor observes: readings with delay, bias and noise; the mirror image of all observations."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from go1_smoke import MODEL, ROBOT, SMOKE, N
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.config import ObservationConfig
from footfall.envs.delays import delayed_readings
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.terms.data import example_data
from footfall.robots.symmetry import ROTATION, VECTOR, find_symmetry
from footfall.train.config import load_preset

KEY = jax.random.PRNGKey(0)


def observing(*terms: ObservationConfig, noise: Noise, **biases: float) -> LocomotionEnv:
    ranges = Randomisation(**{name: Distribution(value, value) for name, value in biases.items()})
    return LocomotionEnv(ROBOT, replace(SMOKE, observation=terms, noise=noise, randomisation=ranges))


def test_readings_are_mujocos() -> None:
    data = mujoco.MjData(MODEL)
    attitude = Rotation.from_quat([0.1, -0.3, 0.2, 0.9])
    data.qpos[3:7], data.qpos[7:] = attitude.as_quat(scalar_first=True), np.linspace(-0.5, 0.5, N)
    data.qvel[:] = np.linspace(-1, 1, 18)
    mujoco.mj_forward(MODEL, data)
    observer = LocomotionEnv(ROBOT, SMOKE).observer
    read = observer.readings(jnp.asarray(data.qpos), jnp.asarray(data.qvel), jnp.zeros(N))
    expected = [*data.qvel[3:6], *attitude.inv().apply([0, 0, -1]), *data.qpos[7:], *data.qvel[6:]]
    np.testing.assert_allclose(read, expected, atol=1e-6)


def test_readings_are_interpolated_between_physics_steps() -> None:
    for delay_s, expected in ((0.0, 7.0), (0.005, 6.0), (0.0075, 5.5), (1.0, 0.0)):
        found = delayed_readings(jnp.arange(8.0)[:, None], jnp.float32(delay_s), 0.005)
        assert float(found[0]) == pytest.approx(expected)


@pytest.mark.parametrize("name", ["accelerometer_bias_m_s2", "accelerometer_noise_m_s2"])
def test_errors_of_a_sensor_that_nothing_reads_are_refused_by_name(name: str) -> None:
    with pytest.raises(UserError, match=name):
        observing(ObservationConfig("gyro"), noise=Noise(), **{name: 0.1})


def test_noise_is_added_after_bias_and_gravity_is_a_unit_vector_after_both() -> None:
    """A bias of 0.75 on (0, 0, -1) gives the direction (3, 3, -1), which noise shifts."""
    terms = (ObservationConfig(term) for term in ("gyro", "gravity", "joint_position", "joint_velocity"))
    env = observing(*terms, noise=Noise(gravity=0.1, gyro=0.5), gravity_bias=0.75, gyro_bias=0.2)
    level = jnp.tile(jnp.zeros(30).at[5].set(-1.0), (8, 1))
    u = jnp.full(env.observer.numbers, 0.5).at[:6].set(jnp.array([1.0, 0.5, 0.0, 1.0, 0.5, 0.5]))
    _, seen = env.observer.observe(env.reset(KEY)[0], level, u)
    np.testing.assert_allclose(seen[:3], [0.7, 0.2, -0.3], atol=1e-6)
    noisy = np.array([3.0, 3.0, -1.0]) / np.sqrt(19.0) + [0.1, 0.0, 0.0]
    np.testing.assert_allclose(seen[3:6], noisy / np.linalg.norm(noisy), atol=1e-6)


def test_the_last_action_is_the_newest_for_actor_and_critic() -> None:
    env = observing(ObservationConfig("last_action"), ObservationConfig("command"), noise=SMOKE.noise)
    state = env.reset(KEY)[0]._replace(actions=jnp.outer(jnp.array([1.0, 2.0, 3.0]), jnp.ones(N)))
    state = state._replace(history=env.observer.empty_history())
    _, seen = env.observer.observe(state, jnp.zeros((8, 30)), jnp.full(30, 0.5))
    for found in (seen, env.observer.clean_values(state, jnp.zeros(N))):
        np.testing.assert_array_equal(found, [*np.ones(N), *state.command])


def test_an_episode_begins_with_its_first_frame_as_the_whole_history() -> None:
    env = observing(ObservationConfig("gyro", 1.0, 3), noise=Noise())
    state, first = env.reset(KEY)
    np.testing.assert_array_equal(first["state"][:3], first["state"][6:])
    turning = jnp.zeros((8, 30)).at[:, :3].set(7.0)
    _, then = env.observer.observe(state, turning, jnp.full(30, 0.5))
    np.testing.assert_array_equal(then, [*first["state"][3:], 7.0, 7.0, 7.0])


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
        qvel=normal(18), command=jnp.array([0.7, 0.3, -0.4]), actions=normal(3, 12),
    )  # fmt: skip
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
        linear, angular, joint_velocity = jnp.split(state.qvel, (3, 6))
        state = state._replace(
            sample=sample,
            qpos=state.qpos[order] * np.concatenate([VECTOR, [1.0, -1.0, 1.0, -1.0], joints.sign]),
            qvel=jnp.concatenate([linear * VECTOR, angular * ROTATION, joints(joint_velocity)]),
            command=state.command * jnp.array([1.0, -1.0, -1.0]),
            phase=state.phase + 0.5, actions=joints(state.actions),
        )  # fmt: skip
        contact, clearance, torque = contact[feet], clearance[feet], joints(torque)
    recent = jnp.tile(env.observer.readings(state.qpos, state.qvel, torque), (2 * env.config.substeps, 1))
    no_noise = jnp.full(6 + 2 * env.action_size, 0.5)
    state, seen = env.observer.observe(state, recent, no_noise, is_reset=True)
    data = example_data(env.scene)._replace(contact=contact, clearance=clearance, torque=torque)
    _, seen = env.observations(state, seen, env.data_at(state, data))
    return {name: np.asarray(value) for name, value in seen.items()}
