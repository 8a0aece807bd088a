"""The examples in a user's folder: own terms, task, controller, motors and training loop; a notebook."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from runpy import run_path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from long_tests import long_test
from quick_relaxed import write_quick
from tiny_policy import write_network
from user_folder import EXAMPLES, UserFolder

from footfall import Episode, Robot, load_policy, load_robot, run_episode
from footfall.common.outside import find
from footfall.deploy.config import deploy_config
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.wiring import wiring_of
from footfall.envs.make import make_environment
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import Report
from footfall.robots.description import ROBOTS
from footfall.train.config import load_preset


@pytest.fixture
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> UserFolder:
    """The working folder, outside the repository, with modules that share names with footfall's rooms."""
    monkeypatch.chdir(tmp_path)
    return UserFolder(tmp_path)


def test_every_example_is_in_the_table_and_short() -> None:
    table = (EXAMPLES / "README.md").read_text()
    files = [path for path in EXAMPLES.rglob("*") if path.is_file() and path.suffix not in (".pyc", ".md")]
    assert files
    for path in files:
        assert f"]({path.relative_to(EXAMPLES).as_posix()})" in table, path
        assert len(path.read_text().splitlines()) <= 80, path


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


def rewards(term: Any, data: SimpleNamespace, field: str, values: Any) -> list[float]:
    """Rewards of an example's term with a state, while a field of its data has these values."""
    state, found = term.init(data), []
    for value in values:
        setattr(data, field, jnp.array(value))
        state, reward = term.step(state, data)
        found.append(float(reward))
    return found


def test_air_time_is_rewarded_at_the_landing(user_folder: UserFolder) -> None:
    user_folder.copy("feet_air_time.py")
    term = find("feet_air_time:FeetAirTime", "reward")(threshold_s=0.1)
    data = SimpleNamespace(contact=jnp.ones(2), period_s=0.1, moving=1.0)
    found = rewards(term, data, "contact", [[1.0, 1.0], [1.0, 0.0], [1.0, 0.0], [1.0, 1.0], [1.0, 1.0]])
    np.testing.assert_allclose(found, [0.0, 0.0, 0.0, 0.2, 0.0], atol=1e-6)  # 0.3 s in the air


def test_the_planned_height_rises_to_standing(user_folder: UserFolder) -> None:
    user_folder.copy("stand_up.py")
    term, scene = find("stand_up:Rise", "reward")(duration_s=1.0), SimpleNamespace(standing_height=0.25)
    data = SimpleNamespace(height=jnp.float32(0.15), period_s=0.5, scene=scene)
    *high, low = rewards(term, data, "height", [0.2, 0.25, 0.25, 0.15])
    assert high == pytest.approx([1.0, 1.0, 1.0])
    assert low < 0.01


def test_a_policy_with_an_observation_term_is_deployed(user_folder: UserFolder, go1: Robot) -> None:
    onnx = pytest.importorskip("onnx")
    user_folder.copy("roll_pitch.py", "roll_pitch.yaml")
    env = make_environment(go1, load_preset("roll_pitch.yaml", go1).env)
    weights = np.zeros((env.observation_sizes["state"], env.action_size), np.float32)
    write_network(onnx, user_folder.path / "own.onnx", weights, env.contract)
    quick = ("--duration", "0.3", "--config", write_quick(user_folder.path))
    user_folder.footfall("deploy", "own.onnx", "--command", "0,0,0", *quick)
    (user_folder.path / "roll_pitch.py").unlink()
    assert "roll_pitch" in user_folder.refused("deploy", "own.onnx", "--duration", "0.5")


def test_roll_and_pitch_are_those_of_the_base(user_folder: UserFolder) -> None:
    user_folder.copy("roll_pitch.py")
    term, roll, pitch = find("roll_pitch:roll_pitch", "observation term"), 0.3, -0.2
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


def test_in_push_ups_the_base_sinks_and_rises_while_all_feet_stand(user_folder: UserFolder) -> None:
    user_folder.copy("push_ups.py")
    robot = load_robot("hexapod")
    half_rate = replace(deploy_config(robot), joint_rate_hz=250.0)  # simulated faster
    episode = Episode(lambda _: np.zeros(3), 4.0, config=half_rate)
    trace = run_episode(robot, load_policy("push_ups:PushUps", robot), episode)
    assert not trace.fell
    height = trace.base_position[:, 2]
    lowest, highest = height[200:300].min(), height[200:400].max()  # of the second cycle
    depth = 0.15 * robot.description.standing_height_m
    assert 0.7 * depth < highest - lowest < 1.3 * depth
    assert trace.foot_contact.mean() > 0.95


@pytest.fixture
def acme(user_folder: UserFolder) -> Robot:
    """A user's copy of go1 with the motors of an example."""
    user_folder.copy("motor_driver/acme_driver.py", "motor_driver/acme_motor_end.py")
    folder, indent = user_folder.path / "my_robot", "    protocol: "
    shutil.copytree(ROBOTS / "go1", folder)
    lines = (folder / "robot.yaml").read_text().splitlines()
    changed = [f"{indent}acme_driver:AcmeDriver" if line.startswith(indent) else line for line in lines]
    (folder / "robot.yaml").write_text("\n".join(changed))
    return load_robot(folder)


def test_a_robot_walks_on_the_examples_motors(user_folder: UserFolder, acme: Robot) -> None:
    quick = ("--duration", "1.0", "--config", write_quick(user_folder.path))
    command = ("--robot", "my_robot", "--command", "0.4,0,0", *quick, "--json", "out.json")
    user_folder.footfall("deploy", "go1-flat", *command)
    figures = json.loads((user_folder.path / "out.json").read_text())
    assert figures["final_state"] == "IDLE"
    assert figures["distance_m"] > 0.2


def test_commands_and_replies_of_the_examples_motors_arrive_as_they_were_sent(acme: Robot) -> None:
    wiring = wiring_of(acme)
    driver, end, rng = open_driver(wiring), open_motor_end(wiring), np.random.default_rng(1)
    values = rng.uniform(driver.lowest, driver.highest)
    steps = (driver.highest - driver.lowest) / [[65535], [65535], [255], [255], [65535]]
    assert np.all(np.abs(end.requests(driver.command(values)).values - values) <= 0.51 * steps)
    np.testing.assert_allclose(end.requests(driver.command(2.0 * driver.highest)).values, driver.highest)
    measured, error = values[[0, 1, 4]], np.arange(12, dtype=np.uint64)
    replies = driver.replies(end.reply(np.arange(12), Report(measured, error, np.ones(12, bool), 41)))
    assert np.all(np.abs(replies.values - measured) <= 0.51 * steps[[0, 1, 4]])
    np.testing.assert_array_equal(replies.error, error)
    np.testing.assert_array_equal(replies.temperature_c, 41.0)


@pytest.mark.parametrize("iterations", ["0", "-3"])
def test_ppo_in_torch_refuses_too_few_iterations(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], iterations: str
) -> None:
    pytest.importorskip("torch")
    monkeypatch.setattr("sys.argv", ["ppo_torch.py", iterations])
    with pytest.raises(SystemExit, match="2"):
        run_path(str(EXAMPLES / "ppo_torch.py"), run_name="__main__")
    (line,) = capsys.readouterr().err.splitlines()
    assert iterations in line


@long_test
def test_the_return_of_ppo_in_torch_rises(user_folder: UserFolder) -> None:
    pytest.importorskip("torch")
    user_folder.copy("ppo_torch.py")
    output = user_folder.python("ppo_torch.py", "12")
    returns = [float(number) for number in re.findall(r"mean return (\S+)", output)]
    assert len(returns) == 12
    assert returns[-1] > returns[0] + 0.5


def test_the_notebook_trains_deploys_and_plots(
    user_folder: UserFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It runs from its first cell to its last one in a Jupyter kernel."""
    nbformat, nbclient, *_ = map(pytest.importorskip, ("nbformat", "nbclient", "ipykernel", "matplotlib"))
    monkeypatch.setenv("MPLBACKEND", "agg")
    user_folder.copy("train_evaluate_deploy.ipynb")
    notebook = nbformat.read(user_folder.path / "train_evaluate_deploy.ipynb", as_version=4)
    nbformat.validate(notebook)
    (parameters,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", ())]
    (user_folder.path / "quick.yaml").write_text(
        "{base: smoke, ppo: {total_steps: 256, actor_hidden_dims: [8], critic_hidden_dims: [8]},"
        " env: {physics: c, critic: [{term: height}], rewards: [{term: alive, weight: 1.0}], events: []}}"
    )
    parameters.source += '\npreset, episodes = "quick.yaml", 1'  # the values do not matter here
    for cell in notebook.cells:
        cell.source = cell.source.replace("duration_s=8.0", "duration_s=1.0")
    resources = {"metadata": {"path": str(user_folder.path)}}
    nbclient.NotebookClient(notebook, resources=resources, timeout=600).execute()
    for name in ("runs/notebook/policy.onnx", "walk.mcap", "walk.png"):
        assert (user_folder.path / name).stat().st_size > 0
    cells = [cell for cell in notebook.cells[4:9] if cell.cell_type == "code"]  # train, evaluate, deploy
    for cell, shown in zip(cells, ("policy.onnx", "nominal", " m"), strict=True):
        texts = [each.get("text") or each.get("data", {}).get("text/plain", "") for each in cell.outputs]
        assert shown in "\n".join(texts)
