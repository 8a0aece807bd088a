"""The examples of own terms: a reward with a state, an observation term, a task."""

import json
from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from long_tests import long_test
from tiny_policy import write_network
from user_folder import UserFolder

from footfall.common.outside import find
from footfall.envs.make import make_environment
from footfall.robots.description import Robot
from footfall.train.config import load_preset


@long_test
@pytest.mark.parametrize(
    ("example", "reward"), [("feet_air_time", "air_time"), ("roll_pitch", "total"), ("stand_up", "Rise")]
)
def test_an_example_is_trained_with(user_folder: UserFolder, example: str, reward: str) -> None:
    """A few steps by the example's preset, with the engine that compiles fastest."""
    user_folder.copy(f"{example}.py", f"{example}.yaml")
    preset = user_folder.path / f"{example}.yaml"
    smaller = preset.read_text().replace("base: cpu", "base: smoke")
    preset.write_text(smaller.replace("\nenv:\n", "\nenv:\n  physics: c\n"))
    options = ("--preset", preset.name, "--steps", "1024", "--out", "runs/own", "--no-evaluate")
    user_folder.footfall("train", "--robot", "go1", *options)
    lines = (user_folder.path / "runs/own/metrics.jsonl").read_text().splitlines()
    value = json.loads(lines[-1])[f"reward/{reward}"]
    assert np.isfinite(value)
    assert value != 0.0


def test_air_time_is_rewarded_at_the_landing(user_folder: UserFolder) -> None:
    user_folder.copy("feet_air_time.py")
    term = find("feet_air_time:FeetAirTime", "reward")(threshold_s=0.1)
    contacts = jnp.array([[1.0, 1.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0]])
    data = SimpleNamespace(contact=contacts[0], period_s=0.1, moving=1.0)
    state, rewards = term.init(data), []
    for contact in contacts:
        data.contact = contact
        state, reward = term.step(state, data)
        rewards.append(float(reward))
    np.testing.assert_allclose(rewards, [0.0, 0.0, 0.0, 0.2, 0.0], atol=1e-6)  # 0.3 s in the air


def test_a_policy_with_an_observation_term_is_deployed(user_folder: UserFolder, go1: Robot) -> None:
    onnx = pytest.importorskip("onnx")
    user_folder.copy("roll_pitch.py", "roll_pitch.yaml")
    env = make_environment(go1, load_preset("roll_pitch.yaml", go1).env)
    weights = np.zeros((env.observation_sizes["state"], env.action_size), np.float32)
    write_network(onnx, user_folder.path / "own.onnx", weights, env.contract)
    user_folder.footfall("deploy", "own.onnx", "--command", "0,0,0", "--duration", "0.5")
    (user_folder.path / "roll_pitch.py").unlink()
    assert "roll_pitch" in user_folder.refused("deploy", "own.onnx", "--duration", "0.5")


def test_roll_and_pitch_are_those_of_the_base(user_folder: UserFolder) -> None:
    user_folder.copy("roll_pitch.py")
    term = find("roll_pitch:roll_pitch", "observation term")
    roll, pitch = 0.3, -0.2
    gravity = np.array([np.sin(pitch), -np.sin(roll) * np.cos(pitch), -np.cos(roll) * np.cos(pitch)])
    for array in (np.asarray, jnp.asarray):
        inputs = SimpleNamespace(readings={"gravity": array(gravity)})
        np.testing.assert_allclose(term.source(inputs, None), [roll, pitch], atol=1e-6)
        np.testing.assert_allclose(term.source(inputs, None, limit_rad=0.25), [0.25, pitch], atol=1e-6)


def test_episodes_begin_crouched_on_the_ground(user_folder: UserFolder, go1: Robot) -> None:
    user_folder.copy("stand_up.py", "stand_up.yaml")
    env = make_environment(go1, load_preset("stand_up.yaml", go1).env)
    keys = jax.random.split(jax.random.PRNGKey(0), 6)
    qpos = np.asarray(jax.jit(jax.vmap(lambda key: env.reset(key)[0].qpos))(keys))
    standing = go1.description.standing_height_m
    assert len(np.unique(qpos[:, 2])) > 1
    for height, joints in zip(qpos[:, 2], qpos[:, 7:], strict=True):
        assert 0.5 * standing - 1e-3 < height < 0.8 * standing + 1e-3
        foot = go1.legs.pose(joints.astype(float)).foot
        np.testing.assert_allclose(height + foot[:, 2], standing + go1.legs.default_foot[:, 2], atol=1e-3)


def test_the_planned_height_rises_to_standing(user_folder: UserFolder) -> None:
    user_folder.copy("stand_up.py")
    term = find("stand_up:Rise", "reward")(duration_s=1.0)
    data = SimpleNamespace(
        height=jnp.float32(0.15), period_s=0.5, scene=SimpleNamespace(standing_height=0.25)
    )
    state, rewards = term.init(data), []
    for height in (0.2, 0.25, 0.25, 0.15):
        data.height = jnp.float32(height)
        state, reward = term.step(state, data)
        rewards.append(float(reward))
    assert rewards[:3] == pytest.approx([1.0, 1.0, 1.0])
    assert rewards[3] < 0.01
