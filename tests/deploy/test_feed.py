"""The feed of a run: its content; no subscriber delays the run or another subscriber."""

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

import numpy as np
import pytest
from deploy_policies import Hold

from footfall import Robot, UserError
from footfall.deploy.log import McapLog
from footfall.deploy.log_file import read_log
from footfall.deploy.modes import Mode
from footfall.deploy.receiver import MotorHealth
from footfall.deploy.safety import State
from footfall.deploy.telemetry.feed_reader import FeedMessage, FeedReader
from footfall.policies.policy import Sensed

START_NS = 1_700_000_000_000_000_000
LATCHED = {"/robot_description", "/tf_static", "/state", "/motor_health"}
HEALTH = MotorHealth(np.zeros(13), *np.zeros((3, 12)))
STILL = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), *np.zeros((3, 12)))


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
        log.tick(2000 * tick, STILL, HEALTH, np.zeros((5, 12)))


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
