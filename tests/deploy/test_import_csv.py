"""A recording in a CSV file becomes a log with the estimators' outputs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from deploy_policies import short_episode
from scipy.spatial.transform import Rotation
from shell import Shell

from footfall import UserError, load_policy, load_robot, run_episode
from footfall.common.config import structure
from footfall.deploy.log_analysis.columns import read_columns
from footfall.deploy.log_analysis.recorded_csv import ColumnMap, read_csv
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.plant.robot import SimulatedRobot

ROBOT = load_robot("go1")
JOINTS = ROBOT.joint_names
FEET = tuple(foot.name for foot in ROBOT.description.feet)
MOUNTING = Rotation.from_euler("xyz", [180.0, 0.0, 90.0], degrees=True)  # IMU's axes to the base's
MAP: dict[str, Any] = {
    "time": "t",
    "gyro": ["wx", "wy", "wz"],
    "acceleration": ["ax", "ay", "az"],
    "joint_position": {name: f"q_{name}" for name in JOINTS},
    "joint_torque": {name: f"tau_{name}" for name in JOINTS},
    "imu_mounting": MOUNTING.as_quat(scalar_first=True).tolist(),
    "rate_unit_rad_s": float(np.pi / 180.0),
}
STANDING = {"time": "t", "joint_position": dict.fromkeys(JOINTS, "a")}
Walk = tuple[Path, np.ndarray]


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Walk:
    """A rest and a trot, recorded by a rotated IMU without orientation; and the true path, m."""
    rows, positions = [], []

    def note(loop: ControlLoop, body: SimulatedRobot) -> None:
        sensed = loop.sensed
        if not sensed.acceleration.any() or loop.state.mode not in (Mode.IDLE, Mode.STANDING, Mode.WALKING):
            return
        gyro, acceleration = (MOUNTING.inv().apply(value) for value in (sensed.gyro, sensed.acceleration))
        joints = *sensed.joint_position, *sensed.joint_torque
        rows.append([loop.now_us * 1e-6, *np.degrees(gyro), *acceleration, *joints])
        positions.append(body.truth().base_position)

    ahead = short_episode(command_source=lambda _: np.array([0.6, 0.0, 0.0]), duration_s=1.5)
    run_episode(ROBOT, load_policy("trot", ROBOT), ahead, note)
    rest = [[row * 0.002, *rows[0][1:]] for row in range(-300, 0)]
    names = ["t,wx,wy,wz,ax,ay,az", *MAP["joint_position"].values(), *MAP["joint_torque"].values()]
    path = tmp_path_factory.mktemp("recording") / "walk.csv"
    np.savetxt(path, [*rest, *rows], delimiter=",", header=",".join(names), comments="")
    return path, positions[-1] - positions[0]


def command(table: Path, folder: Path, chart: dict[str, Any]) -> list[str | Path]:
    """The command that imports a table by a map into a folder."""
    (folder / "map.yaml").write_text(yaml.safe_dump(chart))
    more = ["--map", folder / "map.yaml", "--out", folder / "walk.mcap"]
    return ["log", "import", table, "--robot", "go1", *more]


def test_the_log_contains_the_walked_path(shell: Shell, walk: Walk, tmp_path: Path) -> None:
    result = shell(*command(walk[0], tmp_path, MAP))
    assert result.status == 0, result
    columns, count = read_columns(tmp_path / "walk.mcap"), len(JOINTS)
    rows = np.loadtxt(walk[0], delimiter=",", skiprows=1)
    assert columns.readings.values[:, :count] == pytest.approx(rows[:, 7 : 7 + count])
    assert columns.readings.time_s == pytest.approx(rows[:, 0] - rows[0, 0], abs=1e-6)
    position = columns.column("/odom", 85).values[-1, :2]
    assert np.linalg.norm(walk[1][:2]) > 0.4
    assert np.linalg.norm(position - walk[1][:2]) < 0.05
    assert 0.3 < columns.column("/contacts", 4).values[-50:].mean() < 0.9
    assert shell("log", "info", tmp_path / "walk.mcap").status == 0


def test_foot_forces_may_replace_torques(shell: Shell, walk: Walk, tmp_path: Path) -> None:
    """Feet without load: the acceleration's column, which is about zero, replaces the force."""
    changes = {"joint_torque": {}, "foot_force": dict.fromkeys(FEET, "ax")}
    assert shell(*command(walk[0], tmp_path, MAP | changes)).status == 0
    assert read_columns(tmp_path / "walk.mcap").column("/contacts", 4).values[-50:].max() < 0.1
    assert shell(*command(walk[0], tmp_path, MAP | {"joint_torque": {}})).status == 0
    counts = read_columns(tmp_path / "walk.mcap").counts
    assert counts["/joint_states"] > 800
    assert "/odom" not in counts


def test_an_unfit_map(shell: Shell, walk: Walk, tmp_path: Path) -> None:
    for changes, named in (
        ({"time": "clock"}, "clock"),
        ({"joint_position": {"knee": "t"}}, "FR_hip_joint"),
        ({"foot_force": dict.fromkeys((*FEET, "tail"), "ax")}, "tail"),
        ({"time_unit_s": -1.0}, "time_unit_s"),
        ({"time": "ax"}, "line"),
        ({"gyro": ["ax", "ay", "az"]}, "never at rest"),  # no attitude
    ):
        assert named in shell.refuses(*command(walk[0], tmp_path, MAP | changes))


def test_tables_of_spreadsheets_are_read_and_a_cell_without_a_number_is_refused(tmp_path: Path) -> None:
    path, chart = tmp_path / "theirs.csv", structure(STANDING, ColumnMap, "map")
    for text in ("\ufefft,a\n0.0,1.0\n0.1,2.0\n", "t;a\n0.0;1.0\n0.1;2.0\n", "t\ta\n0\t1\n.1\t2\n"):
        path.write_text(text, encoding="utf-8")
        assert read_csv(path, chart, ROBOT).position[:, 0].tolist() == [1.0, 2.0]
    path.write_text("t,a\n0.0,1.0\n0.1,\n")
    with pytest.raises(UserError, match="line 3"):
        read_csv(path, chart, ROBOT)


def test_nanoseconds_without_their_unit_are_refused(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "theirs.csv"
    path.write_text("t,a\n1700000000000000000,1.0\n1700000000002000000,2.0\n")
    for unit_s in (1.0, 1e-3, 1e-6):
        chart = STANDING | {"time_unit_s": unit_s}
        assert "time_unit_s" in shell.refuses(*command(path, tmp_path, chart))
    assert shell(*command(path, tmp_path, STANDING | {"time_unit_s": 1e-9})[:-2]).status == 0
