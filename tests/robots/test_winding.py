"""Temperature of the winding and derating: one thermal model in training and behind the bus."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from changed_robots import with_each_motor
from deploy_policies import short_episode
from edited import content_of
from refused import refusal_of

from footfall import Robot, UserError, load_policy, load_robot, run_episode
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.locomotion import LocomotionEnv
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motors import SimulatedMotors
from footfall.robots.winding import Winding, torque_share, warmed
from footfall.train.config import load_preset

CONFIG = load_preset("smoke").env

TIME_CONSTANT_S, STEP_S = 10.0, 0.002
N = 12
THERMAL = {"thermal_resistance_k_w": 2.0, "thermal_capacity_j_k": 5.0}


@pytest.fixture(scope="module")
def heated() -> Robot:
    """A go1 with windings of 2 K/W and 5 J/K, whose current limit falls from 80 to 120 degrees."""
    return with_each_motor(load_robot("go1"), **THERMAL, derating_c=(80.0, 120.0))


def winding_of(robot: Robot) -> Winding:
    assert robot.winding is not None
    return robot.winding


@pytest.mark.parametrize("steps", [1, 7, 1000])
def test_a_winding_warms_and_cools_with_the_time_constant(heated: Robot, steps: int) -> None:
    """After R_th C the rise is 1 - 1/e of R_th R I^2, in steps of any length."""
    winding, torque = winding_of(heated), 6.0
    temperature_c = np.full(N, 25.0)
    for _ in range(steps):
        temperature_c = warmed(temperature_c, np.full(N, torque**2), winding, TIME_CONSTANT_S / steps)
    motors = [heated.description.motors[joint.motor] for joint in heated.description.joints]
    current_a = np.array([torque / (m.torque_constant_nm_a * m.gear_ratio) for m in motors])
    loss_w = np.array([m.winding_resistance_ohm for m in motors]) * current_a**2
    np.testing.assert_allclose(temperature_c - 25.0, 2.0 * loss_w * (1 - np.exp(-1)), rtol=1e-12)
    cooled = warmed(np.full(N, 125.0), np.zeros(N), winding, 2 * TIME_CONSTANT_S)
    np.testing.assert_allclose(cooled, 25.0 + 100.0 * np.exp(-2), rtol=1e-12)


def test_the_current_limit_falls_between_two_temperatures(heated: Robot) -> None:
    for temperature_c, share in ((25.0, 1.0), (80.0, 1.0), (90.0, 0.75), (120.0, 0.0), (150.0, 0.0)):
        found = torque_share(np.full(N, temperature_c), winding_of(heated))
        np.testing.assert_allclose(found, share, rtol=1e-12)
    without_derating = winding_of(with_each_motor(heated, derating_c=None))
    np.testing.assert_array_equal(torque_share(np.full(N, 500.0), without_derating), 1.0)


def test_an_incomplete_thermal_model_is_refused(own_folder: Path) -> None:
    for changes, complaint in (
        ({"thermal_resistance_k_w": 2.0}, "thermal_capacity_j_k"),
        ({"thermal_resistance_k_w": None, "derating_c": [80.0, 120.0]}, "thermal_resistance_k_w"),
        (THERMAL | {"derating_c": [80.0, 80.0]}, "derating_c"),
    ):
        with content_of(own_folder / "robot.yaml") as content:
            content["motors"]["hip"].update(changes)
        assert complaint in refusal_of(load_robot, own_folder)


def test_a_drawn_winding_temperature_needs_a_thermal_model(go1: Robot) -> None:
    with pytest.raises(UserError, match=r"winding_rise_k.*thermal_resistance_k_w"):
        walk(go1, {"winding_rise_k": np.full(N, 10.0)})
    config = replace(CONFIG, randomisation=Randomisation(winding_rise_k=Distribution(0.0, 50.0)))
    with pytest.raises(UserError, match=r"winding_rise_k.*thermal_resistance_k_w"):
        LocomotionEnv(go1, config)


def walk(robot: Robot, sample: dict[str, np.ndarray]) -> SimpleNamespace:
    """go1-flat for a second; its trace, and temperatures reported at the end."""
    seen: list[np.ndarray] = []
    episode = short_episode(command_source=lambda _: np.array([0.5, 0.0, 0.0]), sample=sample)
    policy = load_policy("go1-flat", robot)
    trace = run_episode(robot, policy, episode, lambda loop, _: seen.append(loop.temperature_c))
    return SimpleNamespace(trace=trace, reported_c=seen[-1])


def after_constant_torque(
    robot: Robot, sample: dict[str, np.ndarray], torque: float, seconds: float
) -> tuple[np.ndarray, np.ndarray]:
    """Final torque and winding temperature of enabled motors at rest after a constant commanded torque."""
    motors = SimulatedMotors(
        open_motor_end(wiring_of(robot)), robot.motor, N, sample, STEP_S, winding=robot.winding
    )
    motors.enabled[:] = True
    motors._note_enabled()
    motors._watchdog.check = lambda *_: None  # type: ignore[method-assign]
    motors._values[4] = torque
    for step in range(round(seconds / STEP_S)):
        delivered = motors.torque(step, np.zeros(N), np.zeros(N))
    return delivered, motors.drivetrain.winding_c


def test_behind_the_bus_a_held_torque_warms_and_a_hot_motor_delivers_its_derated_torque(
    heated: Robot,
) -> None:
    sample = {"ambient_k": np.array(-15.0), "winding_heating": np.full(N, 1.5)}
    _, winding_c = after_constant_torque(heated, sample, 4.0, TIME_CONSTANT_S)
    rise = 1.5 * winding_of(heated).heating * 16.0 * (1 - np.exp(-1))
    np.testing.assert_allclose(winding_c, 10.0 + rise, rtol=1e-9)
    at_100_degrees = {"winding_rise_k": np.full(N, 75.0)}  # half the current
    delivered, _ = after_constant_torque(heated, at_100_degrees, 100.0, STEP_S)
    np.testing.assert_allclose(delivered, 0.5 * heated.motor.peak_torque)


def test_the_robot_walks_and_reports_its_temperatures(heated: Robot) -> None:
    """Motors are hot at first and cool; those with a load cool less. A frame has whole degrees."""
    found = walk(heated, {"winding_rise_k": np.full(N, 35.0)})
    assert not found.trace.fell
    assert not found.trace.faults
    assert (found.reported_c == np.rint(found.reported_c)).all()
    cooled = 25.0 + 35.0 * np.exp(-found.trace.run_s / TIME_CONSTANT_S)
    assert found.reported_c.min() >= np.rint(cooled)
    assert found.reported_c.max() >= cooled + 2.0


def test_training_and_bus_have_the_same_thermal_model(heated: Robot) -> None:
    """The torque changes for a second, in control steps of training and in physics steps behind the bus."""
    env = LocomotionEnv(heated, CONFIG)
    sample = {"winding_rise_k": np.full(N, 40.0)}
    on_bus = np.full(N, 65.0)
    in_training = env.actuation.initial_winding_c(sample)
    np.testing.assert_allclose(in_training, on_bus, rtol=1e-6)
    for step in 10.0 * np.random.default_rng(0).random((50, 10, N)):
        in_training = env.actuation.next_winding_c(in_training, jnp.asarray(step), sample)
        for each in step:
            on_bus = warmed(on_bus, each**2, winding_of(heated), env.period_s / len(step))
    np.testing.assert_allclose(in_training, on_bus, rtol=1e-3)
