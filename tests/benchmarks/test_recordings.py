"""Benchmarks on recordings of real machines, with recordings made up in the same format."""

import json
from pathlib import Path

import ak80_6
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from recordings import double_pendulum, servo_logs, servo_pendulum
from recordings.rollout import Inputs, rollouts

from footfall.common.errors import UserError

STEP_S = double_pendulum.STEP_S
SWINGS = {**ak80_6.PUBLISHED, "strength_2": 0.9, "delay_1": 0.0, "delay_2": 0.006, "load_friction_1": 0.05}


def test_a_rollout_of_one_window_is_delayed_and_scaled() -> None:
    """A unit force acts on a unit mass from the first step on: the position is t² / 2, later by the delay."""
    numbers = (double_pendulum.EFFECTS[4], double_pendulum.EFFECTS[6])  # delay_1, strength_2
    given = np.where(np.arange(120) >= 20, 1.0, 0.0)[None, :, None]
    inputs = Inputs(given, 20, 0.01, np.array([[0.0, 49.5, 100.0]]))
    push = rollouts(lambda value, state, drive: drive, inputs, numbers, ("delay_1",), ("strength_2",))
    moved = push(np.array([[0.0, 0.055], [1.0, 2.0]]), np.zeros((2, 1, 2)))
    assert moved.shape == (2, 1, 3, 1)
    np.testing.assert_allclose(moved[0, 0, :, 0], [0.0, 0.5 * 0.495**2, 0.5], atol=0.006)
    np.testing.assert_allclose(moved[1, 0, 2, 0], 0.945**2, atol=0.012)


def made_up(path: Path, seed: int) -> None:
    """A CSV recording of a double pendulum whose numbers are known."""
    rng, count = np.random.default_rng(seed), round(3.0 / STEP_S)
    time_s = STEP_S * np.arange(count)
    hz, phase, size = rng.uniform(0.4, 2.0, (3, 2)), rng.uniform(0, 6, (3, 2)), np.array([2.0, 0.8])
    torque = (size * np.sin(2 * np.pi * hz * time_s[:, None, None] + phase)).sum(axis=1) / 2
    late = np.roll(torque, 6, axis=0) * (1.0, 0.9)
    late[:, 0] = torque[:, 0]

    def step(state: jnp.ndarray, drive: jnp.ndarray) -> tuple[jnp.ndarray, jnp.ndarray]:
        speed = state[2:] + STEP_S * double_pendulum.acceleration(SWINGS, state, drive)
        after = jnp.concatenate([state[:2] + STEP_S * speed, speed])
        return after, state[:2]

    _, position = jax.lax.scan(step, jnp.zeros(4), jnp.asarray(late))
    rows = np.column_stack([time_s, position, torque])[::2]
    np.savetxt(path, rows, delimiter=",", header="time,pos1,pos2,tau1,tau2", comments="")


def test_a_made_up_double_pendulum_is_found_and_its_motion_explained(tmp_path: Path) -> None:
    """From two recordings; in a cross-validation each block is held out once."""
    for seed in range(2):
        made_up(tmp_path / f"design_A.0_{seed}.csv", seed)
    windows = ak80_6.problem(str(tmp_path))
    numbers = windows.fit(rounds=2, iterations=5)
    found = ak80_6.derived(numbers)
    assert found["length_1"] == pytest.approx(0.3, rel=0.02)
    assert found["strength_2"] == pytest.approx(0.9, rel=0.03)
    assert found["delay_2"] == pytest.approx(0.006, abs=0.001)
    assert ak80_6.explained(windows.errors(numbers), windows.measured).min() > 0.9995
    times = sum(ak80_6.held_out(windows, "blocks", fold).astype(int) for fold in range(ak80_6.FOLDS))
    assert (times == 1).all()


def test_a_folder_without_recordings_or_columns_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError):
        ak80_6.files(str(tmp_path))
    bad = tmp_path / "bad.csv"
    bad.write_text("time,tau1,tau2\n0,0,0\n1,0,0\n")
    with pytest.raises(UserError, match="pos"):
        ak80_6.read(bad)


TURNS = {**dict.fromkeys(servo_pendulum.LAW, 0.0), "kt": 0.4, "resistance": 5.0, "armature": 0.002}
TURNS |= {"coulomb": 0.01, "viscous": 0.004, "stribeck_speed": 0.3, "duty_resistance": 0.4, "offset": 0.02}


def made_up_servo(path: Path, gain: float, hz: float) -> None:
    """A JSON recording of a servo whose numbers are known, at 200 Hz."""
    per_rad = servo_logs.SERVOS["xl330"].duty_per_rad * gain
    goal = 1.2 * np.sin(2 * np.pi * hz * 0.005 * np.arange(460) ** 1.1)
    given = np.repeat(
        np.column_stack([goal, *np.tile([[1], [per_rad], [0.5], [0.1], [7.4]], 460)]), 5, axis=0
    )

    def step(state: jnp.ndarray, given: jnp.ndarray) -> tuple[jnp.ndarray, jnp.ndarray]:
        speed = state[1] + STEP_S * servo_pendulum.acceleration(TURNS, state, given)[0]
        return jnp.stack([state[0] + STEP_S * speed, speed]), state[0]

    _, position = jax.lax.scan(step, jnp.zeros(2), jnp.asarray(given))
    entries = [
        {"timestamp": 0.005 * row, "position": float(at), "goal_position": float(to), "torque_enable": True}
        for row, (at, to) in enumerate(zip(position[::5], goal, strict=True))
    ]
    rest = {"kp": gain, "mass": 0.5, "length": 0.1, "vin": 7.4, "trajectory": "made up"}
    path.write_text(json.dumps({**rest, "entries": entries}))


def test_a_made_up_servo_is_found_and_gains_are_held_out(tmp_path: Path) -> None:
    for index, (gain, hz) in enumerate(((200.0, 0.5), (800.0, 0.8), (800.0, 0.3))):
        made_up_servo(tmp_path / f"{index}.json", gain, hz)
    folder = str(tmp_path)
    assert servo_logs.folds(folder, "xl330") == [("kp 200", [0]), ("kp 800", [1, 2])]
    windows = servo_logs.problem(folder, "xl330", "joint law")
    numbers = dict(zip((each.name for each in windows.parameters), windows.fit(rounds=2), strict=True))
    assert numbers["kt"] == pytest.approx(0.4, rel=0.05)
    assert numbers["duty_resistance"] == pytest.approx(0.4, abs=0.1)
    assert numbers["offset"] == pytest.approx(0.02, abs=0.005)
    with pytest.raises(UserError):
        servo_logs.read(Path(__file__), servo_logs.SERVOS["xl330"])
