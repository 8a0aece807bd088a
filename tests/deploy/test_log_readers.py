"""Logs read by rosbags, with ROS 2's own definitions; subscribers of a feed, which delay no run."""

import json
import os
import select
import socket
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from changed_robots import with_foot_sensors
from deploy_policies import Hold
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from footfall import JointCommand, PolicyInput, Robot, UserError
from footfall.deploy.battery import BatteryState
from footfall.deploy.changes import Change
from footfall.deploy.estimation.odometry import Odometry
from footfall.deploy.frames import EXTENDED, FD, Frames
from footfall.deploy.log import McapLog
from footfall.deploy.log_file import read_log
from footfall.deploy.log_records import Kind
from footfall.deploy.modes import Mode
from footfall.deploy.orders import Order, OrderKind
from footfall.deploy.receiver import MotorHealth
from footfall.deploy.safety import State
from footfall.deploy.telemetry.definitions import definition
from footfall.deploy.telemetry.feed_reader import FeedMessage, FeedReader
from footfall.deploy.telemetry.messages import text
from footfall.deploy.telemetry.topics import TOPICS
from footfall.policies.live_settings import Applied
from footfall.policies.policy import Sensed

START_NS = 1_700_000_000_000_000_000
LATCHED = {"/robot_description", "/tf_static", "/state", "/motor_health"}
STILL = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), *np.zeros((3, 12)))


@pytest.fixture(scope="module")
def messages(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[Any]]:
    """The messages of a log with every topic, by topic. Each is encoded again, which gives its bytes."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    policy = Hold(go1)
    policy.observed, policy.action = np.arange(3.0), np.arange(12.0)  # type: ignore[attr-defined]
    log = McapLog(path, with_foot_sensors(go1), policy, {}, may_wait=True)
    log.begin(START_NS)
    still = np.zeros(3)
    sensed = STILL._replace(joint_position=go1.default_pose, foot_force=np.ones(4))
    command = JointCommand(*np.zeros((5, 12)))
    error = 7.0 * (np.arange(12) == 3)
    health = MotorHealth(np.full(13, 0.001), np.full(12, 41.0), np.full(12, 24.0), error)
    footholds = np.where(np.arange(4)[:, None] == 1, [0.2, 0.1, -0.3], np.nan)
    data = np.arange(64, dtype=np.uint8)
    fd = Frames(np.array([0]), np.array([0x17D | FD]), data[None], np.array([48]))
    identifiers = np.array([0x12, 0x1ABCDEF | EXTENDED])
    frames = Frames(np.array([0, 1]), identifiers, data[:16].reshape(2, 8), np.array([8, 5]))
    log.state(0, State(Mode.WALKING, 0.0))
    log.note(0, "a note")
    log.change(0, Change(gait="walk"))
    log.order(0, Order(OrderKind.STEER, "page 1"))
    log.applied(0, Applied("walk", {"step.period_s": 0.5}))
    for now_us in (0, 1_100_000):
        log.frames(now_us, Kind.RECEIVED, frames.at(np.array([now_us - 10, now_us])))
        log.frames(now_us, Kind.RECEIVED, fd.at(np.array([now_us])))
        inputs = PolicyInput(0.0, sensed, np.array([0.5, 0.0, 0.0]), still, 0.3)
        log.policy_step(now_us, inputs, command, policy)
        log.frames(now_us, Kind.SENT, frames)
        log.frames(now_us, Kind.SENT, fd)
        log.tick(now_us, sensed, health, np.zeros((5, 12)))
        where = Odometry(still, sensed.quaternion, 0.0, still, still, 0.3, np.ones(4), np.eye(7))
        log.odometry(now_us, where, footholds)
        log.battery(now_us, BatteryState(0.75, 0.01, 24.5, 3.0))
        log.timing(now_us, 150.0, 20.0)
    log.state(1_200_000, State(Mode.ESTOP, 1.2, ("no reply",)))
    assert log.close() == ""
    store = get_typestore(Stores.ROS2_JAZZY)
    for kind in ("can_msgs/msg/Frame", "ros2_socketcan_msgs/msg/FdFrame"):  # not of ROS itself
        store.register(get_types_from_msg(definition(kind).split("\n=")[0], kind))
    found: dict[str, list[Any]] = {}
    with AnyReader([path], default_typestore=store) as reader:
        for connection, _, content in reader.messages():
            message = store.deserialize_cdr(content, connection.msgtype)
            assert bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(content), connection.topic
            found.setdefault(connection.topic, []).append(message)
    return found


def test_logs_of_version_0_2_are_read_by_the_names_of_today(tmp_path: Path) -> None:
    with (tmp_path / "old.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "footfall")
        writer.add_metadata("footfall", {"robot": '"go1"'})
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        writer.add_message(writer.register_channel("/imu", "cdr", schema), 1, text("old"), 1)
        writer.finish()
    (entry,) = read_log(tmp_path / "old.mcap", ["/imu/data"]).entries
    assert (entry.topic, entry.message.data) == ("/imu/data", "old")


def test_markers_of_a_walk(messages: dict[str, list[Any]]) -> None:
    (array,) = messages["/markers"]
    drawn = {marker.ns for marker in array.markers}
    assert {"centre_of_mass", "capture_point", "support_polygon", "velocity"} <= drawn
    (hold,) = [marker for marker in array.markers if marker.ns == "footholds"]  # the other feet stand
    assert hold.id == 1
    assert [getattr(hold.pose.position, axis) for axis in "xyz"] == pytest.approx([0.2, 0.1, -0.3])
    (ahead,) = [marker for marker in array.markers if marker.ns == "commanded_velocity"]
    assert ahead.points[1].x - ahead.points[0].x == pytest.approx(0.25)
    assert {marker.header.frame_id for marker in array.markers} == {"odom"}


def test_every_topic_is_read_and_an_error_is_diagnosed(go1: Robot, messages: dict[str, list[Any]]) -> None:
    assert set(messages) == set(TOPICS)
    events = [(event.level, event.msg) for event in messages["/rosout"] if not event.msg.startswith("{")]
    assert events == [(20, "WALKING"), (30, "a note"), (40, "ESTOP: no reply")]
    first, second = messages["/diagnostics"]
    found = {status.name.partition(": ")[2]: status for status in second.status}
    assert found["motors"].level in (2, b"\x02")
    assert go1.joint_names[3] in found["motors"].message
    assert {"state", "readings", "loop"} <= set(found)
    assert second.header.stamp.sec - first.header.stamp.sec == 1


def test_frames_and_battery(messages: dict[str, list[Any]]) -> None:
    early, late = messages["/from_can_bus"][-2:]
    assert (early.id, early.is_extended, early.dlc, early.header.frame_id) == (0x12, False, 8, "can0")
    assert (late.id, late.is_extended, late.dlc, late.header.frame_id) == (0x1ABCDEF, True, 5, "can1")
    assert late.data.tolist() == list(range(8, 16))
    assert late.header.stamp.nanosec - early.header.stamp.nanosec == 10_000
    battery = messages["/battery_state"][0]
    assert (battery.present, battery.voltage, battery.current, battery.percentage) == (1, 24.5, -3.0, 0.75)


@pytest.fixture
def log(go1: Robot, tmp_path: Path) -> Iterator[McapLog]:
    """A run with a log and a feed that has started and stands."""
    log = McapLog(tmp_path / "run.mcap", go1, Hold(go1), {}, may_wait=True, feed=tmp_path / "feed")
    log.begin(START_NS)
    log.state(0, State(Mode.STANDING, 0.0))
    yield log
    log.close()


def ticks(log: McapLog, count: int, first: int = 0) -> None:
    for tick in range(first, first + count):
        log.tick(2000 * tick, STILL, MotorHealth(np.zeros(13), *np.zeros((3, 12))), np.zeros((5, 12)))


def connect(path: Path, number: int) -> list[socket.socket]:
    found = [socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) for _ in range(number)]
    for each in found:
        each.connect(os.fspath(path))
    return found


def test_a_late_subscriber_gets_the_latched_part_then_all_bytes(log: McapLog, tmp_path: Path) -> None:
    ticks(log, 5)
    with closing(FeedReader(tmp_path / "feed", timeout_s=30.0)) as reader:
        arriving = iter(reader)
        first: list[FeedMessage] = []
        while not {each.channel.topic for each in first} >= LATCHED:
            # Other messages may come first if the process is slower than this one.
            first.append(next(arriving))
        assert any(b"STANDING" in each.data for each in first if each.channel.topic == "/state")
        with ThreadPoolExecutor(1) as subscriber:  # reads while the run goes on, or its buffer may fill
            rest = subscriber.submit(list, arriving)
            ticks(log, 50, first=5)
            log.close()
        live = [each for each in (*first, *rest.result()) if not each.channel.latched]
        assert reader.ended
        assert json.loads(reader.metadata["robot"]) == "go1"
    assert live
    assert not gaps(live)
    kept = [(e.topic, e.time_ns) for e in read_log(tmp_path / "run.mcap").entries]
    fed = [(each.channel.topic, each.time_ns) for each in live]
    assert fed == [each for each in kept if each[0] in {topic for topic, _ in fed}][-len(fed) :]


def gaps(found: list[FeedMessage]) -> bool:
    """Whether messages of a topic are missing between others."""
    by_topic: dict[str, list[int]] = defaultdict(list)
    for each in found:
        by_topic[each.channel.topic].append(each.sequence)
    return any((np.diff(numbers) != 1).any() for numbers in by_topic.values())


def test_a_wrong_or_slow_subscriber_affects_no_other(log: McapLog, tmp_path: Path) -> None:
    """One subscriber never reads, another sends data, and there are more subscribers than the limit."""
    *sleepers, talker = connect(tmp_path / "feed", 15)
    talker.sendall(b"GET / HTTP/1.1\r\n\r\n")
    with closing(FeedReader(tmp_path / "feed", timeout_s=30.0)) as reader:
        arriving = iter(reader)
        seen = [next(arriving) for _ in range(3)]
        crowd = connect(tmp_path / "feed", 8)
        for tick in range(0, 1000, 50):
            started = time.perf_counter()
            ticks(log, 50, first=tick)
            assert time.perf_counter() - started < 20.0
            while seen[-1].time_ns < START_NS + 2_000_000 * (tick + 49):
                seen.append(next(arriving))
        assert not gaps(seen)
    assert log.close() == ""
    assert talker.recv(1 << 20) == b"" or select.select([talker], [], [], 20.0)[0]
    for each in (*sleepers, talker, *crowd):
        each.close()
    assert read_log(tmp_path / "run.mcap").complete


def test_a_feed_in_use_is_refused_and_an_ended_one_replaced(go1: Robot, log: McapLog, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="feed"):
        McapLog(None, go1, Hold(go1), {}, may_wait=True, feed=tmp_path / "feed")
    with socket.socket(socket.AF_UNIX) as unused:
        unused.bind(os.fspath(tmp_path / "unused"))
    again = McapLog(None, go1, Hold(go1), {}, may_wait=True, feed=tmp_path / "unused")
    again.begin(START_NS)
    assert again.close() == ""
    assert not (tmp_path / "unused").exists()


def test_a_run_that_ends_while_its_scene_is_loaded_waits_for_the_scene() -> None:
    """Extension modules that a daemon thread imports sometimes crash the interpreter at its end."""
    program = """
import sys, time, types
class Scene:
    def __init__(self, *_):
        time.sleep(0.3)
        print("loaded", flush=True)
sys.modules["footfall.deploy.telemetry.scene"] = types.SimpleNamespace(Scene=Scene)
from footfall.deploy.telemetry.scene_feeder import SceneFeeder
SceneFeeder({"paced": True, "robot_folder": "", "robot_digest": ""}, print).odometry(b"")
"""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.stdout, ended.returncode) == ("loaded\n", 0)
