"""`footfall log` and `footfall replay` on the logs of short runs."""

import json
import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from can import CanutilsLogReader
from deploy_policies import FailingPolicy, Sway, not_a_number, short_episode
from edited import edit
from mcap.reader import make_reader
from quick_relaxed import QUICK, write_quick
from shell import Shell
from tiny_policy import write_policy

from footfall import Robot, run_episode
from footfall.deploy.log_analysis.continuity import continuity
from footfall.deploy.log_file import read_log
from footfall.deploy.telemetry.topics import TOPICS
from footfall.robots.description import ROBOTS

FIRST_NS = 10**18


@pytest.fixture(scope="module")
def logged(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Log of a robot that sways for 0.4 s, with CAN frames."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    half_rate = replace(QUICK, joint_rate_hz=250.0)  # half as many messages
    run_episode(go1, Sway(go1), short_episode(duration_s=0.4, config=half_rate, log=path, log_frames=True))
    return path


def test_info_and_page_of_a_sound_run(shell: Shell, logged: Path) -> None:
    result = shell("log", "info", logged)
    assert result.status == 0
    for part in ("sway on go1", "IDLE", "No fault", "Each foot path is continuous", "/joint_states"):
        assert part in result.out, result.out
    assert shell("log", "plot", logged, "--out", "page.html").status == 0
    page = Path("page.html").read_text()
    for part in ("sway on go1", "Torques", "Paths of the feet", "Temperatures", "FR_hip_joint", "WALKING"):
        assert part in page
    assert page.count("<svg") >= 4 * 4


def test_info_and_page_of_a_fault(shell: Shell, go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page lies beside its log."""
    monkeypatch.setattr("footfall.evaluate.report.log_page.plots", lambda _: [])  # they take seconds
    log = Path("logs/bad.mcap")
    log.parent.mkdir()
    run_episode(go1, FailingPolicy(go1, 0.2, not_a_number), short_episode(config=QUICK, log=log))
    result = shell("log", "info", log)
    assert result.status == 1
    assert "the policy's command is not finite" in result.out
    assert shell("log", "plot", log).status == 0
    assert "is not finite" in log.with_suffix(".html").read_text()


def test_a_jump_is_found_and_a_swing_is_not() -> None:
    time_s = np.arange(500) * 0.002
    path = np.stack([0.1 * np.sin(9.0 * time_s), np.maximum(0.0, 0.05 * np.sin(30.0 * time_s))], axis=1)
    assert continuity(time_s, path[:, None], 0.005).jumps == []
    path[300:, 0] += 0.02
    (jump,) = continuity(time_s, path[:, None], 0.005).jumps
    assert jump == (pytest.approx(0.6), 0, pytest.approx(0.02, abs=0.003))


def test_a_cut_keeps_its_range_and_the_latched_messages(shell: Shell, logged: Path) -> None:
    assert shell("log", "cut", logged, "--from", "0.6", "--to", "0.8", "--out", "part.mcap").status == 0
    whole, part = read_log(logged), read_log(Path("part.mcap"))
    inside = [entry for entry in whole.entries if 6 * 10**8 <= entry.time_ns - FIRST_NS <= 8 * 10**8]
    held = part.entries[: len(part.entries) - len(inside)]
    assert {entry.topic for entry in held} >= {"/robot_description", "/tf_static", "/state", "/motor_health"}
    assert {entry.time_ns - FIRST_NS for entry in held} == {6 * 10**8}
    assert [entry[:2] for entry in part.entries[len(held) :]] == [entry[:2] for entry in inside]
    assert not part.complete  # the range ends before the run
    assert part.metadata["robot"] == "go1"
    with Path("part.mcap").open("rb") as file:
        assert make_reader(file).get_summary() is not None
    shell("log", "cut", logged, "--from", "0.6", "--out", "end.mcap")
    assert read_log(Path("end.mcap")).complete
    for wrong in (("--from", "2", "--to", "1"), ("--from", "500"), ("--out", logged)):
        shell.refuses("log", "cut", logged, *wrong)


def test_frames_are_those_that_candump_would_have_seen(shell: Shell, logged: Path, tmp_path: Path) -> None:
    assert shell("log", "frames", logged, "--out", "can.log").status == 0
    frames = list(CanutilsLogReader(tmp_path / "can.log"))
    logged_frames = read_log(logged, ["/from_can_bus", "/to_can_bus"]).entries
    assert len(frames) == len(logged_frames) > 1000
    times_s = [entry.time_ns * 1e-9 for entry in logged_frames]
    assert [frame.timestamp for frame in frames] == pytest.approx(sorted(times_s), abs=1e-6)
    assert {frame.channel for frame in frames} == {"can0", "can1", "can2", "can3"}
    first = min(logged_frames, key=lambda entry: entry.time_ns).message
    assert (frames[0].arbitration_id, bytes(frames[0].data)) == (first.id, bytes(first.data[: first.dlc]))


def test_layouts_name_topics_and_joints(shell: Shell, go1: Robot, logged: Path) -> None:
    for tool in ("foxglove", "plotjuggler"):
        assert shell("log", "layout", logged, "--tool", tool, "--out", tool).status == 0
    foxglove = json.loads(Path("foxglove").read_text())
    paths = [path for panel in foxglove["configById"].values() for path in panel.get("paths", ())]
    assert {path["value"].partition(".")[0] for path in paths} <= set(TOPICS)
    assert set(go1.joint_names) <= {path["label"] for path in paths}
    for path in paths:
        if path["value"].startswith("/joint_states."):
            assert path["value"].endswith(f"[{go1.joint_names.index(path['label'])}]")
    placed = re.findall(r'"(?:first|second)": "(.+)"', Path("foxglove").read_text())
    assert sorted(placed) == sorted(foxglove["configById"])
    curves = [each.get("name", "") for each in ElementTree.parse("plotjuggler").iter("curve")]
    assert {f"/joint_states/{joint}/effort" for joint in go1.joint_names} <= set(curves)


def test_garbage_and_logs_without_frames_are_refused(shell: Shell, go1: Robot, tmp_path: Path) -> None:
    (tmp_path / "garbage.mcap").write_bytes(b"no MCAP")
    for verb in ("info", "plot", "cut", "frames", "recover"):
        assert "not an MCAP" in shell.refuses("log", verb, "garbage.mcap")
    run_episode(go1, Sway(go1), short_episode(duration_s=0.02, log=tmp_path / "a.mcap"))
    assert "--log-frames" in shell.refuses("log", "frames", "a.mcap")


def test_no_verb_overwrites_the_file_that_it_reads(shell: Shell, logged: Path, tmp_path: Path) -> None:
    log = tmp_path / "run.mcap"
    log.write_bytes(logged.read_bytes())
    for verb in ("plot", "cut", "frames", "layout", "recover"):
        shell.refuses("log", verb, log, "--out", log)
    shell.refuses("log", "compare", log, "--json", log)
    shell.refuses("identify", "fit", log, "--json", log)
    shell.refuses("log", "import", log, "--map", log, "--robot", "go1")
    assert log.read_bytes() == logged.read_bytes()


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """Options of a brief run that stands up and lies down quickly."""
    return "--duration", "0.1", "--config", write_quick(tmp_path_factory.mktemp("quick"))


def test_a_log_replays_with_its_settings(shell: Shell, short: tuple[str, ...], tmp_path: Path) -> None:
    """The log's settings count even if the settings' file has changed."""
    mine, files = tmp_path / "mine.yaml", ("--log", "run.mcap", "--json", "run.json")
    mine.write_text("kp: 45.0")
    spec = f"stand@{mine}"
    assert shell("deploy", spec, "--set", "stand.kd=2.5", *short, *files).status == 0
    output = json.loads(Path("run.json").read_text())
    assert output["policy"] == f"{spec}@kd=2.5"
    assert output["settings"].items() >= {"kp": 45.0, "kd": 2.5, "tilt_gain": 0.3}.items()
    mine.write_text("kp: 300.0")
    assert shell("replay", "run.mcap").status == 0
    assert shell("replay", "run.mcap", "--policy", spec).status == 1
    assert shell("replay", "run.mcap", "--policy", "stand@kp=45@kd=2.5").status == 0


def test_a_users_robot_is_found(shell: Shell, short: tuple[str, ...], own_folder: Path) -> None:
    log = "run.mcap"
    edit(own_folder, "robot.yaml", "name: go1", "name: mine")
    assert shell("deploy", "stand", "--robot", own_folder, *short, "--log", log).status == 0
    assert shell("replay", log).status == 0
    edit(own_folder, "robot.yaml", "standing_height_m: 0.2945", "standing_height_m: 0.29")
    assert "give --robot" in shell.refuses("replay", log)
    assert shell("replay", log, "--robot", own_folder).status == 0


def test_the_same_policy_decides_the_same_and_another_differs(shell: Shell, short: tuple[str, ...]) -> None:
    assert shell("deploy", "trot", "--seed", "5", *short, "--log", "run.mcap").status == 0
    outcome = shell("replay", "run.mcap")
    assert outcome.status == 0, outcome.out
    assert "the same decisions" in outcome.out
    outcome = shell("replay", "run.mcap", "--policy", "stand")
    assert "hexapod: its joints are FR_hip_joint" in shell.refuses("replay", "run.mcap", "--robot", "hexapod")
    assert outcome.status == 1
    assert "first difference: step " in outcome.out
    assert "_joint" in outcome.out
    assert shell("replay", "run.mcap", "--policy", "stand", "--tolerance", "100").status == 0


def test_a_log_whose_policy_is_missing_needs_the_option(shell: Shell, short: tuple[str, ...]) -> None:
    walk = write_policy(pytest.importorskip("onnx"), Path("walk.onnx"), ROBOTS / "go1")
    assert shell("deploy", walk, *short, "--log", "run.mcap").status == 0
    walk.rename("moved.onnx")
    assert "--policy" in shell.refuses("replay", "run.mcap")
    assert shell("replay", "run.mcap", "--policy", "moved.onnx").status == 0
