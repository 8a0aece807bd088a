"""Logs: what they hold, that a killed run keeps them, and that a replay finds the first difference."""

import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from deploy_policies import FailingPolicy, Hold, Sway, not_a_number, short_episode
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mutate import mutated, mutated_records
from walking_run import eventually

from footfall import Robot, Trace, UserError, run_episode
from footfall.deploy import log as log_module
from footfall.deploy.config import DeployConfig
from footfall.deploy.estimation.odometry import Odometry
from footfall.deploy.log import McapLog
from footfall.deploy.log_file import LogFile, read_log
from footfall.deploy.loop import ControlLoop
from footfall.deploy.receiver import MotorHealth
from footfall.deploy.recover import recover
from footfall.deploy.replay import replay
from footfall.deploy.telemetry.topics import TOPICS
from footfall.policies.policy import Sensed

UNHURRIED = DeployConfig(stand_s=0.4, joint_rate_hz=250.0)


@pytest.fixture(scope="module")
def logged(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Trace]:
    """The log of an orderly run of Sway, and its trace."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    policy = Sway(go1)
    return path, run_episode(
        go1, policy, short_episode(duration_s=0.5, seed=7, log=path, policy_spec="runs/mine")
    )


@pytest.fixture(scope="module")
def whole(logged: tuple[Path, Trace]) -> LogFile:
    """The whole log, read once."""
    return read_log(logged[0])


def log_of(robot: Robot, folder: Path, may_wait: bool = True) -> tuple[Path, McapLog]:
    """The log of a run that has just started, and its path."""
    log = McapLog(folder / "a.mcap", robot, Hold(robot), facts={}, may_wait=may_wait)
    log.begin(0)
    return folder / "a.mcap", log


class Decoded(NamedTuple):
    """One message as the indexed reader of MCAP's own library finds it."""

    topic: str
    kind: str
    message: Any


def decoded(path: Path, topic: str | None = None) -> list[Decoded]:
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        topics = None if topic is None else [topic]
        return [
            Decoded(channel.topic, schema.name, message)
            for schema, channel, _, message in reader.iter_decoded_messages(topics=topics)
        ]


class TestContent:
    def test_ros_tools_find_every_message_with_its_type(self, logged: tuple[Path, Trace]) -> None:
        path, trace = logged
        messages = decoded(path)
        found = {m.topic: m.kind for m in messages}
        absent = {"/policy/observation", "/policy/action"}  # Sway has no network
        absent |= {"/notes", "/orders", "/policy/changes", "/policy/applied"}
        absent |= {"/odom", "/contacts", "/footholds", "/markers"}  # and needs no estimate
        absent |= {"/foot_forces"}  # go1 has no foot sensors
        absent |= {"/battery_state", "/loop_timing", "/from_can_bus", "/to_can_bus"}
        absent |= {"/from_can_bus_fd", "/to_can_bus_fd"}
        assert found == {topic: how.kind for topic, how in TOPICS.items() if topic not in absent}
        counts = Counter(m.topic for m in messages)
        assert counts["/policy/inputs"] == counts["/policy/command"] == len(trace.compute_ms) == 26
        ticks = int(trace.timing["ticks"]) + 1  # the last one switches the motors off, and is not timed
        assert counts["/joint_states"] == counts["/imu/data"] == ticks == round(500 * trace.run_s) + 1
        states = [m.message.data for m in messages if m.topic == "/state"]
        assert states == ["STANDING", "WALKING", "RELEASING", "IDLE"]

    def test_each_reading_is_in_its_field(self, go1: Robot, tmp_path: Path) -> None:
        """Orientation comes as w x y z and is written by name."""
        position, velocity, torque = (100.0 * k + np.arange(12.0) for k in range(3))
        commanded = 1000.0 * np.arange(1, 6)[:, None] + np.arange(12.0)
        gyro, acceleration = np.array([[1.0, 2, 3], [4.0, 5, 6]])
        quaternion = np.array([0.1, 0.2, 0.3, 0.4])
        path, log = log_of(go1, tmp_path)
        log.tick(0, Sensed(gyro, acceleration, quaternion, position, velocity, torque), HEALTH, commanded)
        assert log.close() == ""
        written = {each.topic: each.message for each in decoded(path)}
        joints, inertial = written["/joint_states"], written["/imu/data"]
        assert list(joints.position) == position.tolist()
        assert list(joints.velocity) == velocity.tolist()
        assert list(joints.effort) == torque.tolist()
        command = written["/joint_commands"]
        assert list(command.name) == list(go1.joint_names)
        assert list(command.position) == commanded[0].tolist()
        assert list(command.velocity) == commanded[1].tolist()
        assert list(command.effort) == commanded[4].tolist()
        assert list(written["/joint_gains"].data) == [*commanded[2], *commanded[3]]
        assert [getattr(inertial.orientation, axis) for axis in "wxyz"] == quaternion.tolist()
        assert [getattr(inertial.angular_velocity, axis) for axis in "xyz"] == gyro.tolist()
        assert [getattr(inertial.linear_acceleration, axis) for axis in "xyz"] == acceleration.tolist()

    def test_ages_come_each_tick_and_motor_health_by_change(self, go1: Robot, tmp_path: Path) -> None:
        path, log = log_of(go1, tmp_path)
        hot = HEALTH._replace(temperature_c=HEALTH.temperature_c + np.arange(12.0))
        faulty = hot._replace(error=np.eye(12, dtype=np.uint8)[3] * 7)
        for tick, health in enumerate((HEALTH, HEALTH, hot, faulty, faulty, HEALTH)):
            log.tick(2000 * tick, STILL, health._replace(age_s=health.age_s + tick), None)
        assert log.close() == ""
        found = read_log(path).entries
        ages = [entry.message.data for entry in found if entry.topic == "/reading_ages"]
        assert [list(each) for each in ages] == [(HEALTH.age_s + tick).tolist() for tick in range(6)]
        health = {e.time_ns: np.reshape(e.message.data, (3, 12)) for e in found if e.topic == "/motor_health"}
        assert list(health) == [0, 4_000_000, 6_000_000, 10_000_000]
        np.testing.assert_array_equal(health[0], np.outer([40.0, np.nan, 0.0], np.ones(12)))
        np.testing.assert_array_equal(health[6_000_000], [hot.temperature_c, hot.voltage, faulty.error])

    def test_each_estimate_is_in_its_field(self, go1: Robot, tmp_path: Path) -> None:
        """ROS counts x, y, z and the turns about them; yaw is the last, and the velocity is in `base`."""
        found = Odometry(
            position=np.array([1.0, 2, 3]),
            orientation=np.array([0.1, 0.2, 0.3, 0.4]),
            yaw=0.0,
            velocity=np.array([4.0, 5, 6]),
            angular_velocity=np.array([7.0, 8, 9]),
            height=0.3,
            contact=np.array([0.0, 0.5, 1.0, 0.25]),
            covariance=np.arange(49.0).reshape(7, 7),
        )
        path, log = log_of(go1, tmp_path)
        log.odometry(20_000, found, np.arange(12.0).reshape(4, 3))
        assert log.close() == ""
        written = {each.topic: each.message for each in decoded(path)}
        odometry = written["/odom"]
        assert (odometry.header.stamp.nanosec, odometry.header.frame_id) == (20_000_000, "odom")
        assert odometry.child_frame_id == "base_link"
        pose, twist = odometry.pose.pose, odometry.twist.twist
        assert [getattr(pose.position, axis) for axis in "xyz"] == [1, 2, 3]
        assert [getattr(pose.orientation, axis) for axis in "wxyz"] == [0.1, 0.2, 0.3, 0.4]
        assert [getattr(twist.linear, axis) for axis in "xyz"] == [4, 5, 6]
        assert [getattr(twist.angular, axis) for axis in "xyz"] == [7, 8, 9]
        spread = np.reshape(odometry.pose.covariance, (6, 6))
        assert spread[1].tolist() == [7, 8, 9, 0, 0, 10]
        assert spread[5].tolist() == [21, 22, 23, 0, 0, 24]
        scatter = np.reshape(odometry.twist.covariance, (6, 6))
        assert scatter[1].tolist() == [39, 40, 41, 0, 0, 0]
        assert not scatter[3:].any()
        assert list(written["/contacts"].data) == found.contact.tolist()
        assert list(written["/footholds"].data) == list(range(12))

    def test_metadata_names_policy_robot_seed_and_bus(self, go1: Robot, whole: LogFile) -> None:
        log = whole  # of the orderly run
        assert log.complete
        assert (log.metadata["policy"], log.metadata["policy_spec"]) == ("sway", "runs/mine")
        assert log.metadata["robot_digest"] == go1.digest
        assert log.metadata["seed"] == 7
        assert (log.metadata["bus"], log.metadata["engine"], log.metadata["plant"]) == ("sim", "mujoco", None)
        assert log.metadata["joints"] == list(go1.joint_names)

    def test_logging_does_not_change_the_run(self, go1: Robot, logged: tuple[Path, Trace]) -> None:
        again = run_episode(go1, Sway(go1), short_episode(duration_s=0.5, seed=7))
        assert np.array_equal(again.qpos, logged[1].qpos)


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
    path, root = tmp_path / "killed.mcap", Path(__file__).parents[2]
    paths = f"{root / 'tests/support'}:{root / 'benchmarks'}:{root / 'src'}"
    command = [sys.executable, "-c", KILLED, str(path)]
    with subprocess.Popen(command, env=os.environ | {"PYTHONPATH": paths}, stdout=subprocess.PIPE) as run:
        assert run.stdout is not None
        try:
            while (seen_us := int(run.stdout.readline())) < 500_000:
                pass
        finally:
            run.kill()
        seen_us = int((b"%d " % seen_us + run.stdout.read()).split()[-1])
    assert eventually(lambda: path.read_bytes()[8:].endswith(b"MCAP0\r\n"))
    log = read_log(path)
    assert not log.complete
    assert log.metadata["policy"] == "hold"
    at_ns = {entry.topic: entry.time_ns for entry in log.entries}
    assert (at_ns["/joint_states"] - at_ns["/robot_description"]) // 1000 >= seen_us - 4_000
    assert decoded(path, "/imu/data")
    assert decoded(path, "/notes")


class TestReplay:
    def test_a_replay_is_equal_to_the_bit(self, go1: Robot, logged: tuple[Path, Trace]) -> None:
        """A tolerance is at least 0."""
        result = replay(logged[0], Sway(go1))
        assert (result.steps, result.complete) == (26, True)
        assert (result.worst_difference, result.first_difference) == (0.0, "")
        for tolerance in (np.nan, np.inf, -1.0):
            with pytest.raises(UserError, match="tolerance"):
                replay(logged[0], Sway(go1), tolerance)

    def test_a_decision_of_nan_is_replayed_as_nan(self, go1: Robot, tmp_path: Path) -> None:
        path = tmp_path / "bad.mcap"
        run_episode(go1, FailingPolicy(go1, 0.1, not_a_number), short_episode(log=path))
        assert replay(path, FailingPolicy(go1, 0.1, not_a_number)).first_difference == ""
        assert "was nan, is 0" in replay(path, Hold(go1)).first_difference


def test_bad_paths_and_contents_are_refused(go1: Robot, tmp_path: Path) -> None:
    policy, path = Hold(go1), tmp_path / "bad.mcap"
    with pytest.raises(UserError, match=r"folder\.mcap"):
        run_episode(go1, policy, short_episode(log=tmp_path / "no" / "such" / "folder.mcap"))
    assert not policy.seen  # the run did not begin
    for content in (b"", b"not an mcap at all", b"\x89MCAP0\r\n"):
        path.write_bytes(content)
        with pytest.raises(UserError, match=r"bad\.mcap"):
            replay(path, policy)


HEALTH = MotorHealth(
    np.linspace(0.0, 0.0012, 13), np.full(12, 40.0), np.full(12, np.nan), np.zeros(12, np.uint8)
)
STILL = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), *np.zeros((3, 12)))


def test_a_full_disk_does_not_end_the_run(go1: Robot, capfd: pytest.CaptureFixture[str]) -> None:
    noted_at_us: list[int] = []

    def listen(loop: ControlLoop, _: object) -> None:
        if not noted_at_us and "No space left" in capfd.readouterr().err:
            noted_at_us.append(loop.now_us)

    trace = run_episode(go1, Hold(go1), short_episode(log=Path("/dev/full"), config=UNHURRIED), listen)
    assert trace.final_state == "IDLE"
    assert trace.walked_s == pytest.approx(1.0, abs=0.01)
    assert ["/dev/full" in note for note in trace.notes] == [True]
    assert noted_at_us
    assert noted_at_us[0] < 1_000_000


def test_a_hung_writer_is_abandoned(go1: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_module, "LAST_WAIT_S", 0.3)
    _, log = log_of(go1, tmp_path, may_wait=False)
    os.kill(log._process.pid, signal.SIGSTOP)
    log.tick(0, STILL, HEALTH, None)
    assert "a.mcap" in log.close()


Mutation = Callable[[bytes, np.random.Generator], bytes]


@pytest.mark.parametrize("share", [0.0, 0.5], ids=["the first, which has all definitions", "another"])
def test_a_damaged_chunk(logged: tuple[Path, Trace], whole: LogFile, tmp_path: Path, share: float) -> None:
    """The file's end repeats the definitions of its messages."""
    content = bytearray(logged[0].read_bytes())
    zstd = b"\x28\xb5\x2f\xfd"  # at the head of each chunk's content
    content[content.index(zstd, int(share * len(content))) + 100] ^= 0xFF
    hurt, copy = tmp_path / "hurt.mcap", tmp_path / "whole.mcap"
    hurt.write_bytes(content)
    log = read_log(hurt)
    assert log.damaged == 1
    assert len(whole.entries) * 0.5 < len(log.entries) < len(whole.entries)
    assert recover(hurt, copy) == (len(log.entries), 1)
    recovered = read_log(copy)
    assert recovered.damaged == 0
    assert [each[:2] for each in recovered.entries] == [each[:2] for each in log.entries]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("mutation", [mutated, mutated_records])
def test_no_mutation_gives_a_traceback(
    go1: Robot, logged: tuple[Path, Trace], tmp_path: Path, mutation: Mutation, seed: int
) -> None:
    hurt = tmp_path / "hurt.mcap"
    hurt.write_bytes(mutation(logged[0].read_bytes(), np.random.default_rng(seed)))
    for work in (
        lambda: read_log(hurt),
        lambda: replay(hurt, Sway(go1)),
        lambda: recover(hurt, tmp_path / "whole.mcap"),
    ):
        with suppress(UserError):
            work()
