"""What a robot's own training.yaml changes of the presets."""

from pathlib import Path

import pytest

from footfall.common.errors import UserError
from footfall.robots.description import load_robot
from footfall.train.config import PRESETS, load_preset
from footfall.train.runs.folder import open_run

ZOO = PRESETS.parents[1] / "policies" / "zoo"


def own_training(folder: Path, text: str) -> Path:
    (folder / "training.yaml").write_text(text)
    return folder


def test_it_replaces_what_it_names_and_leaves_the_rest(own_folder: Path) -> None:
    changes = (
        "gait: {frequency_hz: 1.5}",
        "rewards: {torque: -0.5}",
        "commands: {hold_s: {low: 1, high: 2}}",
    )
    robot = load_robot(own_training(own_folder, "\n  ".join(("env:", *changes))))
    mine, shipped = load_preset("cpu", robot).env, load_preset("cpu").env
    assert mine.gait is not None
    assert shipped.gait is not None
    assert (mine.gait.name, mine.gait.frequency_hz) == (shipped.gait.name, 1.5)
    assert mine.rewards == shipped.rewards | {"torque": -0.5}
    assert mine.commands.hold_s.high == 2.0
    assert mine.commands.ranges == shipped.commands.ranges
    assert load_preset("cpu", robot).ppo == load_preset("cpu").ppo


def test_a_preset_in_a_file_is_taken_as_it_is(own_folder: Path, tmp_path: Path) -> None:
    robot = load_robot(own_training(own_folder, "env:\n  gait: {frequency_hz: 1.5}\n"))
    file = tmp_path / "own.yaml"
    file.write_text((PRESETS / "smoke.yaml").read_text())
    assert load_preset(str(file), robot) == load_preset("smoke")


def test_settings_load_under_their_older_names(own_folder: Path, tmp_path: Path) -> None:
    assert load_preset(str(Path(__file__).parent / "old_smoke.yaml")) == load_preset("smoke")
    robot = load_robot(own_training(own_folder, "ppo: {clip: 0.3, discount: 0.9}\n"))
    mine = load_preset("smoke", robot).ppo
    assert (mine.clip_param, mine.gamma) == (0.3, 0.9)
    for policy in ("go1-flat", "g1-flat", "hexapod-flat"):
        ppo = open_run(ZOO / policy).config.ppo
        assert (ppo.num_envs, ppo.clip_param, ppo.actor_hidden_dims) == (32768, 0.2, (512, 256, 128))


def test_an_old_name_beside_the_new_one_is_refused(own_folder: Path) -> None:
    robot = load_robot(own_training(own_folder, "ppo: {clip: 0.3, clip_param: 0.2}\n"))
    with pytest.raises(UserError, match="ppo: no setting clip "):
        load_preset("smoke", robot)


def test_a_robot_without_one_has_the_presets_as_they_are(own_folder: Path) -> None:
    assert load_preset("smoke", load_robot(own_folder)) == load_preset("smoke")


def test_an_unknown_setting_is_refused_with_both_files(own_folder: Path) -> None:
    robot = load_robot(own_training(own_folder, "env:\n  gate: {}\n"))
    with pytest.raises(UserError, match=r"training\.yaml over .*smoke\.yaml: env: no setting gate"):
        load_preset("smoke", robot)
