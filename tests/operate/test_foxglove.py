"""The server for Foxglove and similar viewers, as seen by a client of its protocol."""

import itertools
import json
import struct
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from deploy_policies import Hold
from ports import free_port
from websockets.sync.client import ClientConnection, connect

from footfall import Robot, UserError
from footfall.deploy.log import McapLog
from footfall.deploy.receiver import MotorHealth
from footfall.operate.foxglove import foxglove_served
from footfall.policies.policy import Sensed

pytest.importorskip("foxglove")
WAIT_S = 20.0


def topics_seen(viewer: ClientConnection, expected: set[str], beat: Callable[[], None]) -> set[str]:
    """Subscribe to topics as they are advertised; returns those with a message. Calls `beat` meanwhile."""
    names: dict[int, str] = {}
    seen: set[str] = set()
    until = time.monotonic() + WAIT_S
    while seen < expected and time.monotonic() < until:
        beat()
        try:
            answer = viewer.recv(timeout=0.05)
        except TimeoutError:
            continue
        if isinstance(answer, bytes):
            seen.add(names[struct.unpack_from("<BIQ", answer)[1]])
        elif (message := json.loads(answer))["op"] == "advertise":
            for channel in (each for each in message["channels"] if each["topic"] in expected):
                assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
                names[channel["id"]] = channel["topic"]
                subscriptions = [{"id": channel["id"], "channelId": channel["id"]}]
                viewer.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
    return seen


def test_a_late_viewer_gets_the_robot_and_its_readings_and_cannot_steer(go1: Robot, tmp_path: Path) -> None:
    port, feed, ticks = free_port(), tmp_path / "feed", itertools.count()
    sensed = Sensed(*np.zeros((2, 3)), np.eye(4)[0], go1.default_pose, *np.zeros((2, 12)))
    health = MotorHealth(np.zeros(13), *np.zeros((3, 12)))
    log = McapLog(tmp_path / "run.mcap", go1, Hold(go1), {}, may_wait=True, feed=feed)
    log.begin(10**18)

    def beat() -> None:
        log.tick(2000 * next(ticks), sensed, health, None)

    with foxglove_served(feed, "127.0.0.1", port) as address:
        beat()
        refused = pytest.raises(UserError, match=f"127.0.0.1:{port}")
        with refused, foxglove_served(feed, "127.0.0.1", port):
            pass
        with connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None) as viewer:
            hello = json.loads(viewer.recv(timeout=WAIT_S))
            assert (hello["op"], hello["capabilities"]) == ("serverInfo", [])  # a viewer cannot send anything
            expected = {"/robot_description", "/tf_static", "/joint_states"}
            assert topics_seen(viewer, expected, beat) == expected
    assert log.close() == ""
