"""What the actor observes: readings with delay, bias and noise."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from go1_smoke import MODEL, ROBOT, SMOKE, N

from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.config import ObservationConfig
from footfall.envs.contract import make_contract
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.observe import Observer
from footfall.envs.state import State


@pytest.fixture(scope="module")
def begun() -> State:
    return jax.jit(LocomotionEnv(ROBOT, SMOKE).reset)(jax.random.PRNGKey(0))[0]


class TestObserver:
    TERMS = (
        ObservationConfig("gyro"),
        ObservationConfig("gravity"),
        ObservationConfig("joint_position"),
        ObservationConfig("joint_velocity"),
    )

    def make(self, noise: Noise, **biases: float) -> tuple[Observer, LocomotionEnv]:
        ranges = {name: Distribution(value, value) for name, value in biases.items()}
        config = replace(SMOKE, observation=self.TERMS, noise=noise, randomisation=Randomisation(**ranges))
        env = LocomotionEnv(ROBOT, config)
        return env.observer, env

    def test_readings_are_mujocos(self) -> None:
        data = mujoco.MjData(MODEL)
        data.qpos[3:7] = np.array([0.9, 0.1, -0.3, 0.2]) / np.linalg.norm([0.9, 0.1, -0.3, 0.2])
        data.qpos[7:] = np.linspace(-0.5, 0.5, N)
        data.qvel[:] = np.linspace(-1, 1, 18)
        mujoco.mj_forward(MODEL, data)
        gravity = data.body(ROBOT.description.base).xmat.reshape(3, 3).T @ [0, 0, -1]
        observer = Observer(MODEL, ROBOT, SMOKE, make_contract(ROBOT, SMOKE))
        read = observer.readings(jnp.asarray(data.qpos), jnp.asarray(data.qvel), jnp.zeros(N))
        expected = [*data.qvel[3:6], *gravity, *data.qpos[7:], *data.qvel[6:]]
        np.testing.assert_allclose(read, expected, atol=1e-6)

    @pytest.mark.parametrize("name", ["accelerometer_bias_m_s2", "accelerometer_noise_m_s2"])
    def test_errors_of_a_sensor_that_nothing_reads_are_refused_by_name(self, name: str) -> None:
        with pytest.raises(UserError, match=name):
            self.make(Noise(), **{name: 0.1})

    def test_noise_is_added_after_bias_and_gravity_is_a_unit_vector_after_both(self) -> None:
        """A bias of 0.75 on (0, 0, -1) gives the direction (3, 3, -1).

        Noise shifts this direction, not the raw one.
        """
        observer, env = self.make(Noise(gravity=0.1, gyro=0.5), gravity_bias=0.75, gyro_bias=0.2)
        state, _ = env.reset(jax.random.PRNGKey(0))
        level = jnp.concatenate([jnp.zeros(5), jnp.array([-1.0]), jnp.zeros(24)])
        u = jnp.full(observer.numbers, 0.5).at[:6].set(jnp.array([1.0, 0.5, 0.0, 1.0, 0.5, 0.5]))
        _, seen = observer.observe(state, jnp.tile(level, (8, 1)), u)
        np.testing.assert_allclose(seen[:3], [0.7, 0.2, -0.3], atol=1e-6)
        tilted = np.array([0.75, 0.75, -0.25]) / np.linalg.norm([0.75, 0.75, -0.25])
        noisy = tilted + np.array([0.1, 0.0, 0.0])
        np.testing.assert_allclose(seen[3:6], noisy / np.linalg.norm(noisy), atol=1e-6)

    def test_the_last_action_is_the_newest_for_actor_and_critic(self, begun: State) -> None:
        config = replace(SMOKE, observation=(ObservationConfig("last_action"), ObservationConfig("command")))
        observer = Observer(MODEL, ROBOT, config, make_contract(ROBOT, config))
        actions = jnp.array([[1.0], [2.0], [3.0]]) * jnp.ones(N)
        state = begun._replace(actions=actions, history=observer.empty_history())
        expected = [*np.ones(N), *np.asarray(state.command)]
        _, seen = observer.observe(state, jnp.zeros((8, 30)), jnp.full(30, 0.5))
        np.testing.assert_array_equal(seen, np.float32(expected))
        np.testing.assert_array_equal(observer.clean_values(state, jnp.zeros(N)), np.float32(expected))

    def test_an_episode_begins_with_its_first_frame_as_the_whole_history(self) -> None:
        config = replace(SMOKE, observation=(ObservationConfig("gyro", 1.0, 3),), noise=Noise())
        env = LocomotionEnv(ROBOT, config)
        state, first = env.reset(jax.random.PRNGKey(0))
        np.testing.assert_array_equal(first["state"][:3], first["state"][6:])
        turning = jnp.zeros((8, 30)).at[:, :3].set(7.0)
        _, then = env.observer.observe(state, turning, jnp.full(30, 0.5))
        np.testing.assert_array_equal(then, [*first["state"][3:], 7.0, 7.0, 7.0])
