"""Declarations of randomised quantities, readings and critic terms: YAML, draws, NumPy and JAX."""

import re
from dataclasses import dataclass, fields, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refused import refusal_of

from footfall import Robot, UserError, load_robot
from footfall.common.config import structure
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.quantity import SCALE, quantity, scales
from footfall.domain_rand.randomisation import (
    QUANTITIES,
    Randomisation,
    load_randomisation,
    own_ranges,
    randomisation_of,
)
from footfall.domain_rand.sample import Sample, draw, randomised_motor, sample_shapes, towards_nominal
from footfall.envs.config import NamedTermConfig, ObservationConfig
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.terms import critic
from footfall.policies.contract import Term
from footfall.policies.observation import TERMS, Inputs, reading_term, step_values, term_size
from footfall.robots import kinds
from footfall.robots.readings import READINGS, Noise, Sensed, read, reading
from footfall.robots.symmetry import find_symmetry
from footfall.train.config import load_preset

NAMES = tuple(field.name for field in fields(Randomisation))
DEFAULT = load_randomisation()
# The default randomisation, with quantities of ranges that it lacks.
WHOLE = replace(
    DEFAULT,
    **{
        name: Distribution(max(quantity.lower, 0.0), quantity.upper)
        for name, quantity in QUANTITIES.items()
        if getattr(DEFAULT, name) is None
    },
)
UNIFORMS = np.random.default_rng(0).random(500).astype(np.float32)


def drawn(randomisation: Randomisation, numbers: np.ndarray = UNIFORMS) -> Sample:
    """A sample of 12 joints and 13 bodies from the first of these uniform numbers."""
    return draw(randomisation, lambda k: numbers[:k], 12, 13)


def test_the_gpu_preset_trains_on_the_default_declaration_but_mostly_on_short_delays() -> None:
    trained = load_preset("gpu").env.randomisation
    delays = {name: getattr(trained, name) for name in ("action_delay_s", "observation_delay_s")}
    assert trained == replace(DEFAULT, **delays)
    for name, delay in delays.items():
        widest = getattr(DEFAULT, name)
        assert 0.0 < delay.low < delay.high == widest.high
        assert delay.quantile(0.5) < 0.75 * widest.quantile(0.5)


@pytest.mark.parametrize("name", NAMES)
def test_a_quantity_alone_is_drawn_as_among_all_others_in_numpy_and_jax(name: str) -> None:
    """A quantity does not change other quantities that are drawn from the same numbers."""
    alone = drawn(Randomisation(**{name: getattr(WHOLE, name)}))
    assert list(alone) == [name]
    np.testing.assert_array_equal(alone[name], drawn(WHOLE)[name])
    in_jax = drawn(WHOLE, jnp.asarray(UNIFORMS))
    np.testing.assert_allclose(alone[name], in_jax[name], rtol=1e-6, atol=1e-7)


def test_every_quantity_is_drawn_from_numbers_of_its_own() -> None:
    sample = drawn(WHOLE, UNIFORMS.astype(np.float64))
    ranges = {name: getattr(WHOLE, name) for name in NAMES}
    used = [np.ravel((sample[name] - r.low) / (r.high - r.low)) for name, r in ranges.items()]
    np.testing.assert_allclose(np.concatenate(used), UNIFORMS[: sum(map(len, used))], atol=1e-6)


@given(st.floats(0, 1, exclude_max=True), st.floats(-5, 5), st.floats(0, 5))
def test_uniform_quantile(u: float, low: float, width: float) -> None:
    value = Distribution(low, low + width).quantile(np.array(u))
    assert low <= value <= low + width
    assert value == pytest.approx(low + u * width, abs=1e-12)


def test_log_uniform_halves_its_mass_at_the_geometric_mean() -> None:
    assert Distribution(0.1, 10.0, "log_uniform").quantile(np.array([0.0, 0.5])) == pytest.approx([0.1, 1.0])
    lopsided = Distribution(0.5, 8.0, "log_uniform")  # from half to sixteen times as much
    assert lopsided.quantile(np.array([0.0, 0.25, 0.75, 1.0])) == pytest.approx([0.5, 1.0, 4.0, 8.0])


def test_a_file_sets_exactly_its_quantities(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("friction: {low: 0.25, high: 1, shape: log_uniform}\nkp: {low: 0.9, high: 1.1}")
    friction, kp = Distribution(0.25, 1.0, "log_uniform"), Distribution(0.9, 1.1)
    assert load_randomisation(path) == Randomisation(friction=friction, kp=kp)


def test_all_random_numbers_are_drawn_in_one_call() -> None:
    counts: list[int] = []

    def uniform(count: int) -> np.ndarray:
        counts.append(count)
        return np.full(count, 0.5)

    draw(Randomisation(), uniform, 3, 5)
    shapes = sample_shapes(3, 5)
    assert counts == [sum(int(np.prod(shape)) for shape in shapes.values())]
    names = ("link_mass", "kp", "com_offset_m", "friction")
    assert [shapes[name] for name in names] == [(5,), (3,), (3,), ()]


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_a_share_of_the_difference_is_kept_towards_the_nominal_robot(share: float) -> None:
    sample = draw(DEFAULT, lambda k: np.linspace(0.05, 0.95, k), 12, 13)
    zero = ("payload_kg", "com_offset_m", "joint_damping", "action_delay_s", "observation_delay_s")
    nominal = {"friction": 0.8} | dict.fromkeys((*zero, "encoder_bias", "gyro_bias", "gravity_bias"), 0.0)
    for name, value in towards_nominal(sample, share, friction=0.8).items():
        middle = nominal.get(name, 1.0)
        np.testing.assert_allclose(value, middle + share * (sample[name] - middle), err_msg=name)
    assert towards_nominal({}, share, friction=0.8) == {}


def test_malformed_declaration_is_refused_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    for text, named in (
        ("friction: {low: 1.0, high: 0.5}", "friction"),
        ("friction: {low: 0.0, high: 0.5, shape: log_uniform}", "friction"),
        ("friction: {low: 0.0, high: 0.5, shape: normal}", "friction"),
        ("friction: {low: a, high: 0.5}", "friction"),
        ("friction: {low: 0.5}", "high"),
        ("friction: {low: -0.1, high: 0.5}", "friction .*0 to 10.* -0.1"),
        ("motor_strength: {low: 0.5, high: 11}", "motor_strength .*0 to 10.* 11"),
        ("link_mass: {low: 0.0, high: 1.0}", "link_mass .*0.01 to 100"),
        ("action_delay_s: {low: -0.01, high: 0.01}", "action_delay_s .*0 to 1"),
        ("friction: 0.5", "friction"),
        ("stickiness: {low: 0.5, high: 1.0}", "stickiness"),
        ("- friction", "mapping"),
        ("friction: [", "YAML"),
    ):
        path.write_text(text)
        message = refusal_of(load_randomisation, path)
        assert "mine.yaml" in message
        assert re.search(named, message), message


PAYLOAD, OFFSET = Distribution(-0.1, 0.3), Distribution(-0.03, 0.01)
OWN = "payload_kg: {low: -0.1, high: 0.3}\ncom_offset_m: {high: 0.01}"


def own_robot(folder: Path, text: str = OWN) -> Robot:
    """A robot with a randomisation.yaml of its own."""
    (folder / "randomisation.yaml").write_text(text)
    return load_robot(folder)


def test_a_robots_file_replaces_only_its_own_quantities(own_folder: Path) -> None:
    robot = own_robot(own_folder)
    assert randomisation_of(robot) == replace(DEFAULT, payload_kg=PAYLOAD, com_offset_m=OFFSET)
    assert own_ranges(robot) == {"payload_kg": PAYLOAD, "com_offset_m": OFFSET}


def test_a_robots_malformed_file_is_refused_in_one_line(own_folder: Path) -> None:
    for text, named in (
        ("load_kg: {low: 0, high: 1}", "load_kg"),
        ("payload_kg: {low: 3.0}", "payload_kg"),
        ("- 1", "mapping"),
    ):
        robot = own_robot(own_folder, text)
        for use in (randomisation_of, lambda robot: load_preset("cpu", robot)):
            _, _, complaint = refusal_of(use, robot).partition("randomisation.yaml over ")
            assert named in complaint


def test_presets_take_the_robots_ranges_for_quantities_that_they_randomise(own_folder: Path) -> None:
    """The robot's training.yaml overrides its ranges."""
    robot, shipped = own_robot(own_folder), load_preset("cpu").env.randomisation
    assert load_preset("cpu", robot).env.randomisation == replace(shipped, payload_kg=PAYLOAD)
    assert shipped.com_offset_m is None
    assert load_preset("smoke", robot) == load_preset("smoke")
    (own_folder / "training.yaml").write_text("env: {randomisation: {payload_kg: {low: 0.0, high: 0.1}}}")
    assert load_preset("cpu", own_robot(own_folder)).env.randomisation.payload_kg == Distribution(0.0, 0.1)


ROBOT = load_robot("go1")
CONFIG = load_preset("smoke").env


@dataclass(frozen=True)
class WithTorque(Noise):
    joint_torque: float = reading(kinds.JOINTS, "joint_torque")


@dataclass(frozen=True)
class WithSpeed(Randomisation):
    motor_speed: Distribution | None = quantity(kinds.JOINT_AMOUNTS, SCALE, motor=scales("no_load_speed"))


def declared(cls: type, name: str) -> object:
    return next(each.metadata["declares"] for each in fields(cls) if each.name == name)


@pytest.fixture
def torque(monkeypatch: pytest.MonkeyPatch) -> None:
    """Registers the declaration, as importing it would."""
    monkeypatch.setitem(READINGS, "joint_torque", declared(WithTorque, "joint_torque"))
    monkeypatch.setitem(TERMS, "joint_torque", reading_term("joint_torque"))


@pytest.mark.usefixtures("torque")
class TestReading:
    """A reading needs one declaration."""

    TERMS = (ObservationConfig("joint_torque", 0.1, 2), ObservationConfig("gyro"))
    CONFIG = replace(CONFIG, observation=TERMS, noise=WithTorque())

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
        sensed = Sensed(*np.zeros((2, 3)), np.array([1.0, 0.0, 0.0, 0.0]), *np.zeros((2, 12)), torque)
        inputs = Inputs(read(sensed), np.zeros(12), np.zeros(3), np.zeros(1))
        np.testing.assert_allclose(step_values(inputs, env.contract)[:12], 0.1 * torque)

    def test_a_reading_has_its_own_noise_and_mirror_image(self) -> None:
        env = LocomotionEnv(ROBOT, replace(self.CONFIG, noise=WithTorque(joint_torque=2.0)))
        assert env.observer.numbers == 30 + 12
        state, _ = jax.jit(env.reset)(jax.random.PRNGKey(0))
        true = env.observer.readings(state.qpos, state.qvel, jnp.zeros(12))
        _, seen = env.observer.observe(state, jnp.tile(true, (8, 1)), jnp.full(42, 1.0))
        np.testing.assert_allclose(seen[12:24], np.full(12, 0.2), rtol=1e-6)
        vector = np.arange(27.0)
        mirrored = env.mirror().observation["state"](vector)[12:24]
        np.testing.assert_array_equal(mirrored, find_symmetry(ROBOT).joints(vector[12:24]))


def test_a_quantity_acts_in_training_and_on_the_plant_and_the_critic_sees_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A quantity needs one declaration, and its range is a setting that is checked."""
    monkeypatch.setitem(QUANTITIES, "motor_speed", declared(WithSpeed, "motor_speed"))
    slow = structure({"motor_speed": {"low": 0.5, "high": 0.5}}, WithSpeed, "x.yaml")
    assert slow.motor_speed == Distribution(0.5, 0.5)
    with pytest.raises(UserError, match="motor_speed"):
        structure({"motor_speed": {"low": 0.5, "high": 0.1}}, WithSpeed, "x.yaml")
    env, nominal = (LocomotionEnv(ROBOT, replace(CONFIG, randomisation=r)) for r in (slow, WithSpeed()))
    state, _ = jax.jit(env.reset)(jax.random.PRNGKey(0))
    half = 0.5 * ROBOT.motor.no_load_speed
    drive = env.actuation.drive(jnp.zeros((4, 12)), state.sample)
    np.testing.assert_allclose(drive.motor.no_load_speed, half, rtol=1e-6)
    plants = randomised_motor(ROBOT.motor, {"motor_speed": np.full(12, 0.5)})
    np.testing.assert_allclose(plants.no_load_speed, half)
    size, mirror = env.observation_sizes["privileged_state"], env.mirror().observation["privileged_state"]
    assert size == len(mirror.source) == nominal.observation_sizes["privileged_state"] + 12
    np.testing.assert_array_equal(mirror.sign[-12:], np.ones(12))


def test_a_term_for_the_critic(monkeypatch: pytest.MonkeyPatch) -> None:
    standing = critic.CriticTerm(kinds.SCALAR, lambda data: jnp.sum(data.contact))
    monkeypatch.setitem(critic.CRITIC, "feet_on_the_ground", standing)
    entries = (*CONFIG.critic, NamedTermConfig("feet_on_the_ground"))
    plain, env = (LocomotionEnv(ROBOT, replace(CONFIG, critic=each)) for each in (CONFIG.critic, entries))
    size = plain.observation_sizes["privileged_state"] + 1
    assert env.observation_sizes["privileged_state"] == size
    assert len(env.mirror().observation["privileged_state"].source) == size
