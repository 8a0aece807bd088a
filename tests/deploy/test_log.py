"""Logs: what they hold, that a killed run keeps them, and that a replay finds the first difference."""

import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deploy_policies import FailingPolicy, Hold, Sway, not_a_number, short_episode
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mutate import mutated, mutated_records
from refused import refusal_of
from walking_run import eventually

from footfall import Robot, Trace, UserError, run_episode
from footfall.deploy import log as log_module
from footfall.deploy.config import DeployConfig
from footfall.deploy.estimation.odometry import Odometry
from footfall.deploy.log import McapLog
from footfall.deploy.log_file import read_log
from footfall.deploy.log_store import LogStore
from footfall.deploy.loop import ControlLoop
from footfall.deploy.receiver import MotorHealth
from footfall.deploy.recover import recover
from footfall.deploy.replay import replay
from footfall.deploy.telemetry.topics import TOPICS
from footfall.policies.policy import Sensed

AGES_S = np.linspace(0.0, 0.0012, 13)
HEALTH = MotorHealth(AGES_S, np.full(12, 40.0), np.full(12, np.nan), np.zeros(12, np.uint8))
STILL = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), *np.zeros((3, 12)))


@pytest.fixture(scope="module")
def logged(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Trace]:
    """The log of an orderly run of Sway, and its trace."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    episode = short_episode(duration_s=0.5, seed=7, log=path, policy_spec="runs/mine")
    return path, run_episode(go1, Sway(go1), episode)


def log_of(robot: Robot, folder: Path, may_wait: bool = True) -> tuple[Path, McapLog]:
    """The log of a run that has just started, and its path."""
    log = McapLog(folder / "a.mcap", robot, Hold(robot), facts={}, may_wait=may_wait)
    log.begin(0)
    return folder / "a.mcap", log


def decoded(path: Path, topic: str | None = None) -> list[tuple[str, str, Any]]:
    """Topic, type and content of each message, as the indexed reader of MCAP's own library finds them."""
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        rows = reader.iter_decoded_messages(topics=None if topic is None else [topic])
        return [(channel.topic, schema.name, message) for schema, channel, _, message in rows]


def axes(value: Any, names: str = "xyz") -> list[float]:
    return [getattr(value, axis) for axis in names]


class TestContent:
    def test_ros_tools_find_every_message_with_its_type(self, logged: tuple[Path, Trace]) -> None:
        path, trace = logged
        messages = decoded(path)
        absent = {"/policy/observation", "/policy/action"}  # Sway has no network
        absent |= {"/odom", "/contacts", "/footholds", "/markers"}  # and needs no estimate
        absent |= {"/foot_forces", "/battery_state"}  # go1 has neither
        absent |= {"/notes", "/orders", "/policy/changes", "/policy/applied", "/loop_timing"}
        absent |= {f"/{way}_can_bus{fd}" for way in ("from", "to") for fd in ("", "_fd")}
        expected = {topic: how.kind for topic, how in TOPICS.items() if topic not in absent}
        assert {topic: kind for topic, kind, _ in messages} == expected
        counts = Counter(topic for topic, *_ in messages)
        assert counts["/policy/inputs"] == counts["/policy/command"] == len(trace.compute_ms) == 26
        ticks = int(trace.timing["ticks"]) + 1  # the last one switches the motors off, and is not timed
        assert counts["/joint_states"] == counts["/imu/data"] == ticks == round(500 * trace.run_s) + 1
        states = [message.data for topic, _, message in messages if topic == "/state"]
        assert states == ["STANDING", "WALKING", "RELEASING", "IDLE"]

    def test_each_reading_and_each_estimate_is_in_its_field(self, go1: Robot, tmp_path: Path) -> None:
        """Rows of covariances: x, y, z, and the turns about them. The estimator gives yaw alone."""
        joints = np.array([100.0 * k + np.arange(12.0) for k in range(3)])
        commanded = 1000.0 * np.arange(1, 6)[:, None] + np.arange(12.0)
        gyro, acceleration = np.array([[1.0, 2, 3], [4.0, 5, 6]])
        quaternion = np.array([0.1, 0.2, 0.3, 0.4])
        position, velocity, rate = np.arange(1.0, 10.0).reshape(3, 3)
        contact, covariance = np.array([0.0, 0.5, 1.0, 0.25]), np.arange(49.0).reshape(7, 7)
        odometry = Odometry(position, quaternion, 0.0, velocity, rate, 0.3, contact, covariance)
        path, log = log_of(go1, tmp_path)
        log.tick(0, Sensed(gyro, acceleration, quaternion, *joints), HEALTH, commanded)
        log.odometry(20_000, odometry, np.arange(12.0).reshape(4, 3))
        assert log.close() == ""
        written = {topic: message for topic, _, message in decoded(path)}
        states, command, inertial = map(written.get, ("/joint_states", "/joint_commands", "/imu/data"))
        assert [states.position, states.velocity, states.effort] == joints.tolist()
        assert [command.position, command.velocity, command.effort] == commanded[[0, 1, 4]].tolist()
        assert list(command.name) == list(go1.joint_names)
        assert list(written["/joint_gains"].data) == [*commanded[2], *commanded[3]]
        assert axes(inertial.orientation, "wxyz") == quaternion.tolist()
        assert axes(inertial.angular_velocity) == gyro.tolist()
        assert axes(inertial.linear_acceleration) == acceleration.tolist()
        found = written["/odom"]
        header, pose, twist = found.header, found.pose.pose, found.twist.twist
        assert (header.frame_id, found.child_frame_id) == ("odom", "base_link")
        assert header.stamp.nanosec == 20_000_000
        assert (axes(pose.position), axes(pose.orientation, "wxyz")) == ([1, 2, 3], quaternion.tolist())
        assert (axes(twist.linear), axes(twist.angular)) == ([4, 5, 6], [7, 8, 9])
        spread, scatter = (np.reshape(each.covariance, (6, 6)) for each in (found.pose, found.twist))
        assert spread[[1, 5]].tolist() == [[7, 8, 9, 0, 0, 10], [21, 22, 23, 0, 0, 24]]
        assert scatter[1].tolist() == [39, 40, 41, 0, 0, 0]
        assert not scatter[3:].any()
        assert list(written["/contacts"].data) == contact.tolist()
        assert list(written["/footholds"].data) == list(range(12))

    def test_ages_come_each_tick_and_motor_health_by_change(self, go1: Robot, tmp_path: Path) -> None:
        path, log = log_of(go1, tmp_path)
        hot = HEALTH._replace(temperature_c=HEALTH.temperature_c + np.arange(12.0))
        faulty = hot._replace(error=np.eye(12, dtype=np.uint8)[3] * 7)
        for tick, health in enumerate((HEALTH, HEALTH, hot, faulty, faulty, HEALTH)):
            log.tick(2000 * tick, STILL, health._replace(age_s=health.age_s + tick), None)
        assert log.close() == ""
        found = read_log(path).entries
        ages = [list(entry.message.data) for entry in found if entry.topic == "/reading_ages"]
        assert ages == [(HEALTH.age_s + tick).tolist() for tick in range(6)]
        health = {e.time_ns: np.reshape(e.message.data, (3, 12)) for e in found if e.topic == "/motor_health"}
        assert list(health) == [0, 4_000_000, 6_000_000, 10_000_000]
        np.testing.assert_array_equal(health[0], np.outer([40.0, np.nan, 0.0], np.ones(12)))
        np.testing.assert_array_equal(health[6_000_000], [hot.temperature_c, hot.voltage, faulty.error])

    def test_metadata_name_policy_robot_seed_and_bus(self, go1: Robot, logged: tuple[Path, Trace]) -> None:
        """Logging does not change the run."""
        path, trace = logged
        log = read_log(path)
        expected = {"policy": "sway", "policy_spec": "runs/mine", "robot_digest": go1.digest, "seed": 7}
        expected |= {"bus": "sim", "engine": "mujoco", "plant": None, "joints": list(go1.joint_names)}
        assert log.complete
        assert {name: log.metadata[name] for name in expected} == expected
        again = run_episode(go1, Sway(go1), short_episode(duration_s=0.5, seed=7))
        assert np.array_equal(again.qpos, trace.qpos)


KILLED = """
import os, sys
from pathlib import Path
from deploy_policies import Hold, short_episode
from footfall.plant.episode import run_episode
from footfall.robots.description import load_robot
from relaxed_limits import RELAXED
from walking_run import eventually
robot = load_robot("go1")
episode = short_episode(duration_s=60.0, realtime=True, log=Path(sys.argv[1]), config=RELAXED)
run_episode(robot, Hold(robot), episode, lambda loop, _: os.write(1, b"%d\\n" % loop.now_us))
"""


def test_a_killed_run_keeps_its_log(tmp_path: Path) -> None:
    """Readings reach the file during the run. The writing process outlives the run, and writes the index."""
    path, variables = tmp_path / "killed.mcap", os.environ | {"PYTHONPATH": ":".join(sys.path)}
    command = [sys.executable, "-c", KILLED, str(path)]
    with subprocess.Popen(command, env=variables, stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        try:
            while (seen_us := int(run.stdout.readline())) < 500_000:
                pass
        finally:
            run.kill()
        seen_us = int((b"%d " % seen_us + run.stdout.read()).split()[-1])
    assert eventually(lambda: path.read_bytes()[8:].endswith(b"MCAP0\r\n"))
    log = read_log(path)
    assert (log.complete, log.metadata["policy"]) == (False, "hold")
    at_ns = {entry.topic: entry.time_ns for entry in log.entries}
    assert (at_ns["/joint_states"] - at_ns["/robot_description"]) // 1000 >= seen_us - 4_000
    assert all(decoded(path, topic) for topic in ("/imu/data", "/notes"))


class TestReplay:
    def test_a_replay_is_equal_to_the_bit(self, go1: Robot, logged: tuple[Path, Trace]) -> None:
        """A tolerance is at least 0."""
        result = replay(logged[0], Sway(go1))
        assert (result.steps, result.complete) == (26, True)
        assert (result.worst_difference, result.first_difference) == (0.0, "")
        for tolerance in (np.nan, np.inf, -1.0):
            assert "tolerance" in refusal_of(replay, logged[0], Sway(go1), tolerance)

    def test_a_decision_of_nan_is_replayed_as_nan(self, go1: Robot, tmp_path: Path) -> None:
        path = tmp_path / "bad.mcap"
        run_episode(go1, FailingPolicy(go1, 0.1, not_a_number), short_episode(log=path))
        assert replay(path, FailingPolicy(go1, 0.1, not_a_number)).first_difference == ""
        assert "was nan, is 0" in replay(path, Hold(go1)).first_difference


def test_bad_paths_and_contents_are_refused(go1: Robot, tmp_path: Path) -> None:
    policy, path = Hold(go1), tmp_path / "bad.mcap"
    nowhere = short_episode(log=tmp_path / "no" / "such" / "folder.mcap")
    assert "folder.mcap" in refusal_of(run_episode, go1, policy, nowhere)
    assert not policy.seen  # the run did not begin
    for content in (b"", b"not an mcap at all", b"\x89MCAP0\r\n"):
        path.write_bytes(content)
        assert "bad.mcap" in refusal_of(replay, path, policy)


def test_a_full_disk_does_not_end_the_run(go1: Robot, capfd: pytest.CaptureFixture[str]) -> None:
    noted_at_us: list[int] = []

    def listen(loop: ControlLoop, _: object) -> None:
        if not noted_at_us and "No space left" in capfd.readouterr().err:
            noted_at_us.append(loop.now_us)

    unhurried = DeployConfig(stand_s=0.4, joint_rate_hz=250.0)
    trace = run_episode(go1, Hold(go1), short_episode(log=Path("/dev/full"), config=unhurried), listen)
    assert (trace.final_state, trace.walked_s) == ("IDLE", pytest.approx(1.0, abs=0.01))
    assert ["/dev/full" in note for note in trace.notes] == [True]
    assert noted_at_us[0] < 1_000_000


def test_a_hung_writer_is_abandoned(go1: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_module, "LAST_WAIT_S", 0.3)
    _, log = log_of(go1, tmp_path, may_wait=False)
    os.kill(log._process.pid, signal.SIGSTOP)
    log.tick(0, STILL, HEALTH, None)
    assert "a.mcap" in log.close()


@pytest.mark.parametrize("share", [0.0, 0.5], ids=["the first, which has all definitions", "another"])
def test_a_damaged_chunk(logged: tuple[Path, Trace], tmp_path: Path, share: float) -> None:
    """The file's end repeats the definitions of its messages."""
    content = bytearray(logged[0].read_bytes())
    zstd = b"\x28\xb5\x2f\xfd"  # at the head of each chunk's content
    content[content.index(zstd, int(share * len(content))) + 100] ^= 0xFF
    hurt, copy = tmp_path / "hurt.mcap", tmp_path / "whole.mcap"
    hurt.write_bytes(content)
    log = read_log(hurt)
    assert log.damaged == 1
    assert 0.5 < len(log.entries) / len(read_log(logged[0]).entries) < 1.0
    assert recover(hurt, copy) == (len(log.entries), 1)
    recovered = read_log(copy)
    assert recovered.damaged == 0
    assert [each[:2] for each in recovered.entries] == [each[:2] for each in log.entries]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mutation", [mutated, mutated_records])
def test_no_mutation_gives_a_traceback(
    go1: Robot, logged: tuple[Path, Trace], tmp_path: Path, mutation: Callable[..., bytes], seed: int
) -> None:
    hurt = tmp_path / "hurt.mcap"
    hurt.write_bytes(mutation(logged[0].read_bytes(), np.random.default_rng(seed)))
    for work, *arguments in ((read_log,), (replay, Sway(go1)), (recover, tmp_path / "whole.mcap")):
        with suppress(UserError):
            work(hurt, *arguments)


def test_oldest_automatic_logs_make_room_and_nothing_else_does(tmp_path: Path) -> None:
    oldest, *others = (f"go1-2026010{day}-120000-{7 * day}.mcap" for day in (1, 2, 3))
    for age, name in enumerate([*others[::-1], oldest, "walk.mcap"]):
        (tmp_path / name).write_bytes(bytes(5000 if name == "walk.mcap" else 400))
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    link = tmp_path / "go1-20200101-000000-1.mcap"
    link.symlink_to(tmp_path / "walk.mcap")
    assert LogStore(tmp_path, 1000).new_log("go1").parent == tmp_path
    assert {each.name for each in tmp_path.iterdir()} == {*others, "walk.mcap", link.name}
    (tmp_path / "file").touch()
    assert "--log FILE" in refusal_of(LogStore(tmp_path / "file" / "logs", 1000).new_log, "go1")
