"""A reading, a quantity and a critic term each need one declaration."""

from dataclasses import dataclass, fields, replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from footfall.common.config import structure
from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.quantity import SCALE, quantity, scales
from footfall.domain_rand.randomisation import QUANTITIES, Randomisation
from footfall.domain_rand.sample import randomised_motor
from footfall.envs.config import NamedTermConfig, ObservationConfig
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.terms import critic
from footfall.policies.contract import Term
from footfall.policies.observation import TERMS, Inputs, reading_term, step_values, term_size
from footfall.robots import kinds
from footfall.robots.description import load_robot
from footfall.robots.readings import READINGS, Noise, Sensed, read, reading
from footfall.robots.symmetry import find_symmetry
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
CONFIG = load_preset("smoke").env
NAMES = tuple(each.name for each in fields(Randomisation))


@dataclass(frozen=True)
class WithTorque(Noise):
    """The readings, and the motors' torques."""

    joint_torque: float = reading(kinds.JOINTS, "joint_torque")


@dataclass(frozen=True)
class WithSpeed(Randomisation):
    """The quantities, and the motors' no-load speed."""

    motor_speed: Distribution | None = quantity(kinds.JOINT_AMOUNTS, SCALE, motor=scales("no_load_speed"))


def declared(cls: type, name: str) -> object:
    return next(each.metadata["declares"] for each in fields(cls) if each.name == name)


@pytest.fixture
def torque(monkeypatch: pytest.MonkeyPatch) -> None:
    """Registers the declaration, as importing it would."""
    monkeypatch.setitem(READINGS, "joint_torque", declared(WithTorque, "joint_torque"))
    monkeypatch.setitem(TERMS, "joint_torque", reading_term("joint_torque"))


@pytest.fixture
def speed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(QUANTITIES, "motor_speed", declared(WithSpeed, "motor_speed"))


@pytest.mark.usefixtures("torque")
class TestReading:
    CONFIG = replace(
        CONFIG,
        observation=(ObservationConfig("joint_torque", 0.1, 2), ObservationConfig("gyro")),
        noise=WithTorque(),
    )

    def test_a_readings_noise_is_a_setting_that_is_checked(self) -> None:
        assert structure({"joint_torque": 0.5}, WithTorque, "x.yaml").joint_torque == 0.5
        with pytest.raises(UserError, match="joint_torque"):
            structure({"joint_torque": "much"}, WithTorque, "x.yaml")

    def test_training_and_robot_observe_the_same(self) -> None:
        env = LocomotionEnv(ROBOT, self.CONFIG)
        assert term_size(Term("joint_torque"), env.contract) == 12
        state, seen = jax.jit(env.reset)(jax.random.PRNGKey(0))
        assert seen["state"].shape == (2 * 12 + 3,)
        torque = np.linspace(-6, 6, 12)
        true = env.observer.readings(state.qpos, state.qvel, jnp.asarray(torque))
        u = jnp.full(env.observer.numbers, 0.5)
        _, seen = env.observer.observe(state, jnp.tile(true, (8, 1)), u)
        np.testing.assert_allclose(seen[12:24], 0.1 * torque, rtol=1e-5)
        upright = np.array([1.0, 0.0, 0.0, 0.0])
        sensed = Sensed(np.zeros(3), np.zeros(3), upright, np.zeros(12), np.zeros(12), torque)
        inputs = Inputs(read(sensed), np.zeros(12), np.zeros(3), np.zeros(1))
        np.testing.assert_allclose(step_values(inputs, env.contract)[:12], 0.1 * torque)

    def test_a_reading_has_its_own_noise_and_mirror_image(self) -> None:
        env = LocomotionEnv(ROBOT, replace(self.CONFIG, noise=WithTorque(joint_torque=2.0)))
        assert env.observer.numbers == 30 + 12
        state, _ = jax.jit(env.reset)(jax.random.PRNGKey(0))
        true = env.observer.readings(state.qpos, state.qvel, jnp.zeros(12))
        _, seen = env.observer.observe(state, jnp.tile(true, (8, 1)), jnp.full(42, 1.0))
        np.testing.assert_allclose(seen[12:24], np.full(12, 0.2), rtol=1e-6)
        mirror = env.mirror().observation["state"]
        vector = np.arange(27.0)
        np.testing.assert_array_equal(mirror(vector)[12:24], find_symmetry(ROBOT).joints(vector[12:24]))


@pytest.mark.usefixtures("speed")
class TestQuantity:
    CONFIG = replace(CONFIG, randomisation=WithSpeed(motor_speed=Distribution(0.5, 0.5)))

    def test_a_quantitys_range_is_a_setting_that_is_checked(self) -> None:
        data = {"motor_speed": {"low": 0.5, "high": 0.9}}
        assert structure(data, WithSpeed, "x.yaml").motor_speed == Distribution(0.5, 0.9)
        with pytest.raises(UserError, match="motor_speed"):
            structure({"motor_speed": {"low": 0.5, "high": 0.1}}, WithSpeed, "x.yaml")

    def test_a_quantity_acts_in_training_and_on_the_plant_and_the_critic_sees_it(self) -> None:
        env = LocomotionEnv(ROBOT, self.CONFIG)
        state, _ = jax.jit(env.reset)(jax.random.PRNGKey(0))
        half = 0.5 * ROBOT.motor.no_load_speed
        drive = env.actuation.drive(jnp.zeros((4, 12)), state.sample)
        np.testing.assert_allclose(drive.motor.no_load_speed, half, rtol=1e-6)
        plants = randomised_motor(ROBOT.motor, {"motor_speed": np.full(12, 0.5)})
        np.testing.assert_allclose(plants.no_load_speed, half)
        nominal = LocomotionEnv(ROBOT, replace(CONFIG, randomisation=WithSpeed()))
        size = env.observation_sizes["privileged_state"]
        assert size == nominal.observation_sizes["privileged_state"] + 12
        mirror = env.mirror().observation["privileged_state"]
        assert len(mirror.source) == size
        np.testing.assert_array_equal(mirror.sign[-12:], np.ones(12))


def test_a_term_for_the_critic(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = LocomotionEnv(ROBOT, CONFIG).observation_sizes["privileged_state"]
    standing = critic.CriticTerm(kinds.SCALAR, lambda data: jnp.sum(data.contact))
    monkeypatch.setitem(critic.CRITIC, "feet_on_the_ground", standing)
    entries = (*CONFIG.critic, NamedTermConfig("feet_on_the_ground"))
    env = LocomotionEnv(ROBOT, replace(CONFIG, critic=entries))
    assert env.observation_sizes["privileged_state"] == plain + 1
    assert len(env.mirror().observation["privileged_state"].source) == plain + 1
