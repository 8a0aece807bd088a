"""Readings, biases and delays are declared once and act in training, on the plant and in the log."""

from collections.abc import Iterator
from dataclasses import dataclass, make_dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from scipy.spatial.transform import Rotation

from footfall import Robot, UserError, run_episode
from footfall.deploy.config import DeployConfig
from footfall.deploy.log_file import read_log
from footfall.deploy.safety import SafetyConfig
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.quantity import OFFSET, adds_to, quantity
from footfall.domain_rand.randomisation import QUANTITIES, Randomisation, declared_quantities
from footfall.domain_rand.sample import Sample
from footfall.envs.actuation import Actuation
from footfall.envs.config import ObservationConfig
from footfall.envs.contract import make_contract
from footfall.envs.observe import Observer
from footfall.plant.sensors import IMU, MOTORS, Layout, SimulatedSensors
from footfall.policies.observation import TERMS, reading_term
from footfall.robots import kinds
from footfall.robots.kinds import Parts
from footfall.robots.model import training_model
from footfall.robots.readings import READINGS, SENSED, Readings, Sensed, as_vector, from_vector, read, reading
from footfall.train.config import load_preset

N = 12
UNIT = 0.3  # noise and bias of a reading
LARGEST = 1.3 * UNIT  # of a direction, which is normalised
ROUNDING = 0.03  # of a frame
TICK_S = 0.002
STILL_TICKS = 20  # during which the robot is held before its motors are commanded


@dataclass(frozen=True)
class MoreNoise(Noise):
    """An additional reading."""

    joint_torque: float = reading(kinds.JOINTS, "joint_torque")


@dataclass(frozen=True)
class MoreQuantities(Randomisation):
    """Additional biases and delays."""

    velocity_bias: Distribution | None = quantity(kinds.JOINTS, OFFSET, bias_of="joint_velocity")
    second_gyro_bias: Distribution | None = quantity(kinds.ROTATION, OFFSET, bias_of="gyro")
    bus_delay_s: Distribution | None = quantity(kinds.SCALAR, OFFSET, readings=adds_to("delay_s"))
    motor_delay_s: Distribution | None = quantity(kinds.SCALAR, OFFSET, actions=adds_to("delay_s"))


TORQUE = MoreNoise.__dataclass_fields__["joint_torque"].metadata["declares"]
MORE_READINGS = {**READINGS, "joint_torque": TORQUE}
LOOP = DeployConfig(stand_s=0.05, safety=SafetyConfig(damping_s=0.1))
CONFIG = replace(load_preset("smoke").env, noise=MoreNoise(), randomisation=MoreQuantities())
MORE_QUANTITIES = declared_quantities(MoreQuantities)
BIASES = [name for name, each in MORE_QUANTITIES.items() if each.bias_of is not None]
DELAYS = {
    of: [name for name, each in MORE_QUANTITIES.items() if getattr(each, of) and name.endswith("delay_s")]
    for of in ("actions", "readings")
}


@pytest.fixture(scope="module", autouse=True)
def declared() -> Iterator[None]:
    """Declares the additional quantities, as fields of `Noise` and `Randomisation` do."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(READINGS, "joint_torque", TORQUE)
        patch.setitem(TERMS, "joint_torque", reading_term("joint_torque"))
        for name, each in MORE_QUANTITIES.items():
            patch.setitem(QUANTITIES, name, each)
        yield


def rows_in_log(
    robot: Robot, path: Path, noise: Noise | None = None, sample: Sample | None = None
) -> Readings:
    """Readings in the log of a robot that stands up, shape (ticks, size) each, the first tick left out."""
    still = short_episode(duration_s=0.03, config=LOOP, log=path, noise=noise, sample=sample or {}, seed=3)
    run_episode(robot, Hold(robot), still)
    entries = [each.message for each in read_log(path, ("/joint_states", "/imu/data")).entries]
    rows = []
    for joints, inertial in zip(entries[::2], entries[1::2], strict=True):
        vectors = (
            components(part, "xyz") for part in (inertial.angular_velocity, inertial.linear_acceleration)
        )
        motors = (np.array(part) for part in (joints.position, joints.velocity, joints.effort))
        rows.append(read(Sensed(*vectors, components(inertial.orientation, "wxyz"), *motors)))
    return {name: np.array([row[name] for row in rows[1:]]) for name in READINGS}


def components(message: object, names: str) -> np.ndarray:
    return np.array([getattr(message, name) for name in names])


@pytest.fixture(scope="module")
def nominal(declared: None, go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> Readings:
    return rows_in_log(go1, tmp_path_factory.mktemp("logs") / "nominal.mcap")


def in_training(robot: Robot, noise: Noise, sample: Sample, true: np.ndarray, u: float) -> np.ndarray:
    """The actor's readings for given true readings, concatenated, (physics steps, size)."""
    terms = tuple(ObservationConfig(name) for name in READINGS if name in TERMS)  # the observation has all
    config = replace(CONFIG, noise=noise, observation=terms)
    observer = Observer(training_model(robot), robot, config, make_contract(robot, config))
    zeros = {"actions": jnp.zeros((3, N)), "command": jnp.zeros(3), "phase": jnp.zeros(1)}
    state = SimpleNamespace(sample=sample, history=observer.empty_history(), **zeros)
    state._replace = lambda history: state
    _, seen = observer.observe(state, jnp.asarray(true), jnp.full(observer.numbers, u))
    shown = from_vector(np.asarray(seen), N)
    return as_vector({**shown, "joint_position": shown["joint_position"] + np.float32(robot.default_pose)})


def true_readings(robot: Robot) -> np.ndarray:
    """Readings of a robot that stands still, concatenated."""
    still = {name: np.zeros(declared.kind.size(Parts(N))) for name, declared in READINGS.items()}
    upright = {"gravity": np.array([0.0, 0.0, -1.0]), "joint_position": robot.default_pose}
    return as_vector({**still, **upright})


class TestEveryReading:
    def test_motors_imu_and_feet_report_every_field_of_sensed(self) -> None:
        assert sorted((*MOTORS, *IMU, "foot_force")) == sorted(SENSED)

    @pytest.mark.parametrize("noisy", [tuple(MORE_READINGS), ("joint_torque",)], ids=["all", "one"])
    def test_noise_acts_in_training_on_the_plant_and_in_the_log(
        self, go1: Robot, nominal: Readings, tmp_path: Path, noisy: tuple[str, ...]
    ) -> None:
        noise = MoreNoise(**dict.fromkeys(noisy, UNIT))
        seen = rows_in_log(go1, tmp_path / "noisy.mcap", noise)
        true = true_readings(go1)
        trained = from_vector(np.abs(in_training(go1, noise, {}, true[None], 1.0) - true), N)
        for name in MORE_READINGS:
            error = np.abs(seen[name][:STILL_TICKS] - nominal[name][:STILL_TICKS])
            if name not in noisy:
                assert error.max() == 0.0
                continue
            largest = trained[name].max()
            assert 0.5 * UNIT < largest <= LARGEST
            assert 0.6 * largest < error.max() < LARGEST + ROUNDING
            assert (error.max(axis=0) > 0.3 * largest)[: 2 if name == "gravity" else None].all()

    @pytest.mark.parametrize("more", [["second_gyro_bias"], sorted({*BIASES} - {"second_gyro_bias"})])
    def test_a_bias_acts_in_training_on_the_plant_and_in_the_log(
        self, go1: Robot, nominal: Readings, tmp_path: Path, more: list[str]
    ) -> None:
        kinds_of = {name: MORE_QUANTITIES[name].kind for name in more}
        sample = {name: UNIT * np.linspace(-1.0, 1.0, kind.size(Parts(N))) for name, kind in kinds_of.items()}
        biased = {MORE_QUANTITIES[name].bias_of for name in more}
        true = true_readings(go1)
        trained = from_vector(in_training(go1, MoreNoise(), sample, true[None], 0.5) - true, N)
        seen = rows_in_log(go1, tmp_path / "biased.mcap", sample=sample)
        for each, difference in trained.items():
            largest = np.abs(difference).max()
            assert largest > 0.5 * UNIT if each in biased else largest < 1e-6
            found = seen[each][:STILL_TICKS] - nominal[each][:STILL_TICKS]
            np.testing.assert_allclose(found, np.tile(difference, (STILL_TICKS, 1)), atol=ROUNDING)

    @pytest.mark.parametrize("name", DELAYS["readings"])
    def test_a_delay_acts_in_training_on_the_plant_and_in_the_log(
        self, go1: Robot, nominal: Readings, tmp_path: Path, name: str
    ) -> None:
        recent = np.arange(8.0)[:, None] * np.ones(6 + 3 * N)
        trained = in_training(go1, MoreNoise(), {name: 1.5 * CONFIG.timestep_s}, recent, 0.5)
        np.testing.assert_allclose(trained[:3], np.full(3, 5.5), rtol=1e-6)
        seen = rows_in_log(go1, tmp_path / "late.mcap", sample={name: np.array(2 * TICK_S)})
        for each, values in nominal.items():
            if each not in ("gyro", "gravity"):  # whose latest frames arrive at other ticks of the loop
                np.testing.assert_array_equal(seen[each][2:], values[:-2])
                assert np.ptp(values, axis=0).any()


@pytest.mark.parametrize("name", DELAYS["actions"])
def test_a_delay_of_actions_acts_in_training_and_on_the_plant(
    go1: Robot, nominal: Readings, tmp_path: Path, name: str
) -> None:
    goals = jnp.asarray(go1.default_pose) + jnp.array([[0.01], [0.0], [0.0]])
    late = Actuation(go1, CONFIG).targets(goals, goals[1], {name: 2 * CONFIG.timestep_s})
    np.testing.assert_array_equal(np.ptp(late[:2], axis=0), np.zeros(N))
    assert (late[2] > late[1]).all()
    seen = rows_in_log(go1, tmp_path / "late.mcap", sample={name: np.array(2 * TICK_S)})
    for each, values in nominal.items():
        moved = [int(np.argmax((rows != rows[0]).any(axis=1))) for rows in (values, seen[each])]
        assert moved[1] - moved[0] == 2


class TestRefusals:
    @pytest.mark.parametrize(
        ("declaration", "word"),
        [
            (quantity(kinds.JOINTS, OFFSET), "bias_of"),
            (quantity(kinds.JOINTS, OFFSET, bias_of="joint_current"), "joint_current"),
            (quantity(kinds.VECTOR, OFFSET, bias_of="joint_velocity"), "joint_velocity"),
        ],
    )
    def test_a_quantity_that_would_act_nowhere_is_refused_by_name(self, declaration: Any, word: str) -> None:
        mine = ("mine", Distribution | None, declaration)
        cls = make_dataclass("Own", [mine], bases=(Randomisation,), frozen=True)
        with pytest.raises(ValueError, match=f"'mine'.*{word}"):
            declared_quantities(cls)

    def test_impossible_noise_is_refused(
        self, go1: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        squared = TORQUE._replace(source=lambda torque: torque**2)
        monkeypatch.setitem(READINGS, "joint_torque", squared)
        assert rows_in_log(go1, tmp_path / "quiet.mcap", MoreNoise())["joint_torque"].any()
        with pytest.raises(UserError, match="'joint_torque'"):
            rows_in_log(go1, tmp_path / "noisy.mcap", MoreNoise(joint_torque=0.1))


class PastReadings:
    """Sensors of two joints, listed in reverse, over a state that differs at each step."""

    def __init__(
        self, noise: Noise | None = None, seed: int = 3, mean_velocity: bool = False, **sample: Any
    ) -> None:
        self.data = SimpleNamespace(qpos=np.zeros(10), qvel=np.zeros(9), sensordata=np.zeros(4))
        layout = Layout(np.array([9, 8]), np.array([8, 7]), 1, 1)
        data: Any = self.data
        self.sensors = SimulatedSensors(data, layout, Sample(**sample), noise, 0.001, 2, seed, mean_velocity)

    def step(self, k: int) -> None:
        data = self.data
        data.qpos[8:10], data.qvel[7:9] = (1 + k, 2 + k), (10 + k, 20 + k)
        turn = Rotation.from_euler("xyz", [0.1 * k, 0.2, -0.3])
        data.qpos[4:8], data.qvel[4:7] = turn.as_quat(scalar_first=True), (k, 2 * k, 3 * k)
        data.sensordata[:] = k, 5 * k, 7 * k, -1
        self.sensors.remember(np.array([100.0 + k, 200.0 + k]))


class TestSensors:
    def test_mean_velocities_add_up_to_the_positions(self) -> None:
        """An engine's velocities may alternate from step to step; readings have every second step."""
        past, travel = PastReadings(mean_velocity=True), np.zeros(2)
        for k in range(100):
            past.data.qvel[7:9] = (3.0, -3.0) if k % 2 else (-1.0, 2.0)
            past.data.qpos[8:10] += 0.001 * past.data.qvel[7:9]
            past.sensors.remember(np.zeros(2))
            if k % 2:
                travel += 0.002 * past.sensors.joints(np.zeros(2))[1]
        np.testing.assert_allclose(travel, past.data.qpos[[9, 8]], atol=0.002)

    def test_the_accelerometer_has_its_bias_and_noise_and_the_rest_of_the_imu_has_none(self) -> None:
        bias = np.array([0.3, -0.2, 0.1])
        past = PastReadings(accelerometer_bias_m_s2=bias, accelerometer_noise_m_s2=np.array(0.5))
        past.step(1)
        readings = [past.sensors.inertial() for _ in range(400)]
        errors = np.array([each.acceleration for each in readings]) - [1, 5, 7] - bias
        assert 0.45 < np.abs(errors).max() <= 0.5
        np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.06)
        np.testing.assert_allclose(errors.std(axis=0), 0.5 / np.sqrt(3.0), rtol=0.1)
        np.testing.assert_allclose([each.gyro for each in readings], [[1, 2, 3]] * 400)

    def test_biases_are_the_same_at_every_reading(self) -> None:
        gyro, gravity = np.array([0.1, -0.2, 0.3]), np.array([0.03, -0.05, 0.02])
        past = PastReadings(gyro_bias=gyro, gravity_bias=gravity, encoder_bias=np.array([9.0, 9.0]))
        past.step(1)
        turn = Rotation.from_euler("xyz", [0.1, 0.2, -0.3])
        down = turn.inv().apply([0.0, 0.0, -1.0]) + gravity
        for _ in range(3):
            joints, inertial = past.sensors.joints(np.array([0.5, -0.25])), past.sensors.inertial()
            np.testing.assert_allclose(joints, [[3.5, 1.75], [21, 11], [101, 201]])
            np.testing.assert_allclose(inertial.gyro, [1.1, 1.8, 3.3])
            biased = Rotation.from_quat(inertial.quaternion, scalar_first=True)
            felt = biased.inv().apply([0.0, 0.0, -1.0])
            np.testing.assert_allclose(felt, down / np.linalg.norm(down), atol=1e-12)
            assert (biased * turn.inv()).magnitude() < 0.1  # the heading stays

    def test_noise_has_its_half_width_and_differs_for_each_reading(self) -> None:
        widths = MoreNoise(gyro=0.4, gravity=0.01, joint_position=0.02, joint_velocity=3.0)
        past, again, other = PastReadings(widths), PastReadings(widths), PastReadings(widths, seed=4)
        for each in (past, again, other):
            each.step(0)
        joints = np.array([past.sensors.joints(np.zeros(2)) for _ in range(600)])
        np.testing.assert_array_equal(joints[0], again.sensors.joints(np.zeros(2)))
        assert (joints[0] != other.sensors.joints(np.zeros(2)))[:2].all()
        error = joints - [[2, 1], [20, 10], [100, 200]]
        assert not error[:, 2].any()
        for row, width in ((0, 0.02), (1, 3.0)):
            np.testing.assert_allclose(np.abs(error[:, row]).max(axis=0), width, rtol=0.02)
            np.testing.assert_allclose(error[:, row].mean(axis=0), 0.0, atol=0.1 * width)
        assert len(np.unique(error[:, 0])) == 1200
        inertial = [past.sensors.inertial() for _ in range(600)]
        gyro = np.array([each.gyro for each in inertial])
        np.testing.assert_allclose(np.abs(gyro).max(axis=0), 0.4, rtol=0.02)
        turns = Rotation.from_quat([each.quaternion for each in inertial], scalar_first=True)
        down = turns.inv().apply([0.0, 0.0, -1.0])
        level = Rotation.from_euler("xyz", [0.0, 0.2, -0.3]).inv().apply([0.0, 0.0, -1.0])
        across = (down - level)[:, 1]
        assert np.abs(across).max() == pytest.approx(0.01, rel=0.03)
