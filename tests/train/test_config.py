"""Settings of a training: presets, a robot's own training.yaml, older names, limits."""

from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.robots.description import Robot, load_robot
from footfall.train.config import PRESETS, PpoConfig, load_preset, with_settings
from footfall.train.runs.folder import open_run

SIZES = {"num_envs": 6, "num_steps_per_env": 3, "num_mini_batches": 3, "num_learning_epochs": 4}
PPO: PpoConfig = replace(load_preset("smoke").ppo, **SIZES)


def own_training(folder: Path, text: str) -> Robot:
    """The robot in this folder, with a training.yaml of this text."""
    (folder / "training.yaml").write_text(text)
    return load_robot(folder)


def test_a_robots_file_replaces_only_its_own_keys(own_folder: Path) -> None:
    changes = "gait: {frequency_hz: 1.5}, rewards: {torque: -0.5}, commands: {hold_s: {low: 1, high: 2}}"
    robot = own_training(own_folder, f"env: {{{changes}}}")
    mine, shipped = load_preset("cpu", robot).env, load_preset("cpu").env
    assert mine.gait == replace(shipped.gait, frequency_hz=1.5)
    assert mine.weights == shipped.weights | {"torque": -0.5}
    assert mine.commands == replace(shipped.commands, hold_s=Distribution(1, 2))
    assert load_preset("cpu", robot).ppo == load_preset("cpu").ppo


def test_a_copied_preset_keeps_changes_of_robot_and_user(own_folder: Path, tmp_path: Path) -> None:
    changes = "env: {gait: {frequency_hz: 1.5}, rewards: {torque: -0.5, power: -0.25}}"
    robot = own_training(own_folder, changes)
    copy, text = tmp_path / "own.yaml", (PRESETS / "cpu.yaml").read_text()
    copy.write_text(text)
    adapted = load_preset("cpu", robot)
    assert (load_preset(str(copy), robot), load_preset(str(copy))) == (adapted, load_preset("cpu"))
    edited = yaml.safe_load(text)
    del edited["checkpoint_interval_s"]  # a setting that is left out has its default
    edited["ppo"]["learning_rate"] = 0.002
    next(each for each in edited["env"]["rewards"] if each["term"] == "torque")["weight"] = -0.125
    copy.write_text(yaml.safe_dump(edited))
    mine = load_preset(str(copy), robot)
    assert mine.ppo == replace(adapted.ppo, learning_rate=0.002)
    assert (mine.env.gait, mine.env.weights) == (adapted.env.gait, adapted.env.weights | {"torque": -0.125})


def test_single_settings_are_replaced_by_their_keys() -> None:
    cpu = load_preset("cpu")
    settings = {"ppo.learning_rate": "1e-3", "env.rewards.torque": -0.5, "env.commands.hold_s.high": 9}
    mine = with_settings(cpu, settings, "--set")
    assert mine.ppo == replace(cpu.ppo, learning_rate=0.001)
    assert mine.env.weights == cpu.env.weights | {"torque": -0.5}
    assert mine.env.commands.hold_s.high == 9.0
    for key, named in (
        ("learning_rate", r"ppo\.learning_rate"), ("ppo.learning_rat", "learning_rat"),
        ("env.gait.steps.x", r"env\.gait\.steps\.x"),
    ):  # fmt: skip
        with pytest.raises(UserError, match=f"--set: .*{named}"):
            with_settings(cpu, {key: 1}, "--set")


def test_a_file_has_changes_of_a_base_or_a_complete_configuration(own_folder: Path, tmp_path: Path) -> None:
    """A complete one is a run's config.yaml: it counts even if the robot's file has changed."""
    robot = own_training(own_folder, "env:\n  gait: {frequency_hz: 1.5}\n")
    file = tmp_path / "own.yaml"
    file.write_text(dump(load_preset("cpu")))
    assert load_preset(str(file), robot) == load_preset("cpu")
    file.write_text("base: cpu\nppo: {learning_rate: 2.0e-3}\nenv:\n  rewards: {torque: -0.5}\n")
    mine, base = load_preset(str(file), robot), load_preset("cpu", robot)
    assert mine.ppo == replace(base.ppo, learning_rate=2.0e-3)
    assert mine.env.weights == base.env.weights | {"torque": -0.5}
    assert replace(mine.env, rewards=base.env.rewards) == base.env


def test_a_file_with_a_wrong_base_or_change_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "own.yaml"
    for text, complaint in (
        ("base: fast\n", r"own\.yaml: base: .*'fast'"), ("base: [cpu]\n", r"own\.yaml: base: .*\['cpu'\]"),
        ("base: cpu\nenv: {gate: {}}\n", r"own\.yaml over .*cpu\.yaml: env: .*gate"),
    ):  # fmt: skip
        file.write_text(text)
        with pytest.raises(UserError, match=complaint):
            load_preset(str(file))


def test_settings_load_under_their_older_names(own_folder: Path, tmp_path: Path) -> None:
    assert load_preset(str(Path(__file__).parent / "old_smoke.yaml")) == load_preset("smoke")
    mine = load_preset("smoke", own_training(own_folder, "ppo: {clip: 0.3, discount: 0.9}\n")).ppo
    assert (mine.clip_param, mine.gamma) == (0.3, 0.9)
    for policy in ("go1-flat", "g1-flat", "hexapod-flat"):
        ppo = open_run(PRESETS.parents[1] / "policies" / "zoo" / policy).config.ppo
        assert (ppo.num_envs, ppo.clip_param, ppo.actor_hidden_dims) == (32768, 0.2, (512, 256, 128))


def test_a_wrong_name_is_refused(own_folder: Path) -> None:
    for text, named in (
        ("ppo: {clip: 0.3, clip_param: 0.2}", r"ppo.* clip "),  # an old name beside the new one
        ("env: {rewards: {torqe: {limit: 1}}}", r"training\.yaml: env\..*torque"),
        ("env: {terminations: {tilte: {limit_rad: 1.0}}}", r"training\.yaml: env\..*tilted"),
    ):
        robot = own_training(own_folder, text)
        with pytest.raises(UserError, match=named):
            load_preset("smoke", robot)


def test_a_preset_decides_whether_the_robots_own_changes_act(own_folder: Path, tmp_path: Path) -> None:
    robot = own_training(own_folder, "env: {episode_s: 7.5}")
    assert load_preset("smoke", robot).env.episode_s == 7.5
    assert load_preset("getup", robot) == load_preset("getup")
    path = tmp_path / "mine.yaml"
    for text, acts in (
        ("base: smoke", True), ("base: smoke\ntraining_yaml: false", False),
        ("base: getup", False), ("base: getup\ntraining_yaml: true", True),
        ("training_yaml: false\n" + (PRESETS / "smoke.yaml").read_text(), False),
    ):  # fmt: skip
        path.write_text(text)
        assert (load_preset(str(path), robot).env.episode_s == 7.5) is acts, text
    with pytest.raises(UserError):  # too late: the preset is loaded
        with_settings(load_preset("smoke", robot), {"training_yaml": False}, "--set")


def test_learning_rate_and_entropy_coefficient_fall_linearly() -> None:
    constant = replace(PPO, total_steps=10 * 18, entropy_coef=0.01)
    assert constant.entropy_weight(0) == constant.entropy_weight(10) == 0.01
    falling = replace(constant, final_entropy_coef=0.002, learning_rate=3e-3, final_learning_rate=1e-3)
    assert [falling.entropy_weight(done) for done in (0, 5, 10)] == pytest.approx([0.01, 0.006, 0.002])
    assert [falling.learning_rate_limit(done) for done in (0, 5, 10)] == pytest.approx([3e-3, 2e-3, 1e-3])


def test_iterations_cover_all_steps() -> None:
    for steps, iterations in ((1, 1), (18, 1), (19, 2), (36, 2), (37, 3)):
        assert replace(PPO, total_steps=steps).iterations == iterations
    assert PPO.steps_per_iteration == 18


def test_impossible_settings_are_refused() -> None:
    above_zero = ("total_steps", "num_envs", "num_steps_per_env", "num_mini_batches", "num_learning_epochs")
    above_zero += ("learning_rate", "desired_kl", "clip_param", "max_grad_norm", "init_noise_std")
    layers = ((3, 0), (0,), ())
    for change in (
        *({name: 0} for name in above_zero),
        *({name: each} for name in ("actor_hidden_dims", "critic_hidden_dims") for each in layers),
        *({name: -1e-9} for name in ("final_learning_rate", "entropy_coef", "gamma")),
        {"gamma": 1.01}, {"lam": 1.01}, {"num_envs": 7},
    ):  # fmt: skip
        with pytest.raises(ValueError, match=next(iter(change))):
            replace(PPO, **change)
