"""A recording of another program, with its commands, is compared and fitted like a log of footfall."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from shell import Shell

from footfall.deploy.config import DeployConfig
from footfall.identify.excitation import ExcitationConfig
from footfall.identify.record import record
from footfall.identify.recording import Recording, read_recording
from footfall.identify.simulated import simulated_bus
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
JOINTS = ROBOT.joint_names
PARTS = ("q", "target", "rate", "kp", "kd", "feed")  # columns of each joint
MAP: dict[str, Any] = {
    "time": "t",
    "joint_position": {name: f"q_{name}" for name in JOINTS},
    "target_position": {name: f"target_{name}" for name in JOINTS},
    "target_velocity": {name: f"rate_{name}" for name in JOINTS},
    "stiffness": {name: f"kp_{name}" for name in JOINTS},
    "damping": {name: f"kd_{name}" for name in JOINTS},
    "feed_forward": {name: f"feed_{name}" for name in JOINTS},
}

Pair = tuple[Recording, Path]


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    """A recording of a robot with twice its friction, and the same as another program's CSV file."""
    path = tmp_path_factory.mktemp("recording") / "converted.csv"
    short = ExcitationConfig(settle_s=0.3, triangle_s=0.4, chirp_s=0.6, burst_s=0.2)
    bus = simulated_bus(ROBOT, {"joint_friction": np.full(len(JOINTS), 2.0)})
    record(ROBOT, bus, path.with_suffix(".own"), short, DeployConfig(joint_rate_hz=250.0, stand_s=0.1))
    own = read_recording(path.with_suffix(".own"), ROBOT)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t", *(f"{part}_{name}" for part in PARTS for name in JOINTS)])
        for time_s, position, command in zip(own.time_s, own.position, own.command, strict=True):
            writer.writerow([time_s, *position, *command.ravel()])
    return own, path


def imported(shell: Shell, pair: Pair, folder: Path, **changes: Any) -> Recording:
    """The CSV file, read through a map with changes."""
    assert shell(*import_command(pair, folder, **changes)).status == 0
    return read_recording(folder / "converted.mcap", ROBOT)


def import_command(pair: Pair, folder: Path, **changes: Any) -> list[str | Path]:
    map_file = folder / "map.yaml"
    map_file.write_text(yaml.safe_dump({**MAP, **changes}))
    return ["log", "import", pair[1], "--map", map_file, "--robot", "go1", "--out", folder / "converted.mcap"]


def test_a_file_of_another_program_is_read_and_compared_like_a_log(
    shell: Shell, pair: Pair, tmp_path: Path
) -> None:
    own, converted = pair[0], imported(shell, pair, tmp_path)
    assert converted.command == pytest.approx(own.command)
    assert converted.position == pytest.approx(own.position)
    assert converted.time_s - converted.time_s[0] == pytest.approx(own.time_s - own.time_s[0], abs=2e-6)
    assert np.isnan(converted.torque).all()  # unknown, not a reading of zero
    assert shell("log", "compare", tmp_path / "converted.mcap", "--json", tmp_path / "gap.json").status == 1
    for gap in json.loads((tmp_path / "gap.json").read_text()).values():
        assert gap["error_mrad"] > 2.0 * gap["noise_mrad"]
        assert max(gap["explains"], key=gap["explains"].__getitem__) == "joint_friction", gap
    assert shell("log", "info", tmp_path / "converted.mcap").status == 0


def test_a_gain_may_be_a_number_for_all_joints(shell: Shell, pair: Pair, tmp_path: Path) -> None:
    gains = {"all": 20.0, JOINTS[1]: 30.0}
    command = imported(shell, pair, tmp_path, stiffness=gains, damping={"all": 1.5}, feed_forward={}).command
    for found, expected in (
        (command[:, 2, 0], 20.0),
        (command[:, 2, 1], 30.0),
        (command[:, 3:], [[1.5], [0.0]]),
    ):
        assert (found == expected).all()


def test_incomplete_commands_are_refused(shell: Shell, pair: Pair, tmp_path: Path) -> None:
    for name, wrong, named in (
        ("stiffness", {}, "stiffness"),
        ("target_position", {}, "target_position"),
        ("stiffness", {"all": -1.0}, "stiffness"),
        ("damping", {"all": 1.0, "tail": 1.0}, "tail"),
        ("gyro", ["t", "t", "t"], "acceleration"),
    ):
        assert named in shell.refuses(*import_command(pair, tmp_path, **{name: wrong}))


def test_one_wrong_reading_is_not_noise(pair: Pair, tmp_path: Path, shell: Shell) -> None:
    """If it counted as noise, every error of the model would be small in comparison."""
    lines = pair[1].read_text().splitlines()
    cells = lines[200].split(",")
    cells[3] = "6.4"  # a full turn more
    (tmp_path / "converted.csv").write_text("\n".join([*lines[:200], ",".join(cells), *lines[201:]]))
    assert shell(*import_command((pair[0], tmp_path / "converted.csv"), tmp_path)).status == 0
    assert JOINTS[2] in shell.refuses("log", "compare", tmp_path / "converted.mcap")
