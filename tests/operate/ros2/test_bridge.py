"""A bridge, a process with another Python, receives the feed and steers a run by velocities or paths."""

import cmath
import math
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock, Mock, patch

import numpy as np
import pytest
from import_in_process import ROOT
from walking_run import WALKING, abilities, eventually

from footfall.common.errors import UserError
from footfall.deploy.command_source import UNKNOWN_POSE, Behaviour, Pose
from footfall.deploy.telemetry import messages
from footfall.deploy.telemetry.feed import Feed, listen
from footfall.operate.inbox import Inbox, InboxConfig
from footfall.operate.ros2.bridge_process import Backend, Ros2Config, bridge, find_backend, network_note
from footfall.operate.ros2.height_scans import scans_by_ros2
from footfall.operate.ros2.link import Link
from footfall.operate.ros2.path_source import PathSource
from footfall.operate.ros2.steering_socket import SteeringSocket

STEP_S = 0.02
FAKE = Backend(sys.executable, "fake_bridge", "no ROS")
AT_START = WALKING._replace(pose=Pose(0.0, 0.0, 0.0))


@pytest.fixture
def inbox() -> Inbox:
    """An inbox that tolerates long pauses of its owner, as a busy machine makes them."""
    inbox = Inbox(InboxConfig(still_after_s=60.0, lie_down_after_s=90.0))
    inbox.poll(WALKING)
    return inbox


@pytest.fixture
def paths(inbox: Inbox) -> PathSource:
    return PathSource(inbox, "ros2", abilities)


@pytest.fixture
def path(inbox: Inbox, paths: PathSource, tmp_path: Path) -> Iterator[Path]:
    server = SteeringSocket(tmp_path / "steer", inbox, paths, "ros2")
    yield tmp_path / "steer"
    server.close()


@pytest.fixture(autouse=True)
def finds_fake_bridge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2] / "support"))


def test_requests_reach_the_inbox_and_refusals_are_returned(inbox: Inbox, path: Path) -> None:
    result: list[str] = []
    link = Link(str(path), lambda _: None, result.append)
    assert link.request(velocity=[0.3, 0.0, 0.1], gait="wave", settings={"step_height_m": 0.04}) == ""
    request = inbox.poll(WALKING)
    assert (inbox.owner, request.velocity.tolist()) == ("ros2", [0.3, 0.0, 0.1])
    assert (request.gait, request.settings) == ("wave", {"step_height_m": 0.04})
    not_finite = {"velocity": [float("nan"), 0, 0]}
    for wrong in (not_finite, {"gait": "fly"}, {"weight": 1}, {"behaviour": ["walk"]}):
        assert "\n" not in link.request(**wrong) != ""
    link.post(gait="fly")
    link.post(gait="fly")
    link.post(wish="stand")  # former name
    assert eventually(lambda: inbox.poll(WALKING).behaviour is Behaviour.STAND)
    assert len(result) == 1, "the same refusal is reported once"
    assert inbox.take_over("page") == ""
    assert link.request(velocity=[0.1, 0, 0]) != ""
    assert link.request(take_over=True) == link.request(velocity=[0.1, 0, 0]) == ""
    assert inbox.stopped is None
    assert link.request(stop="a service") == ""
    assert "ros2" in inbox.stopped.reason


def test_the_bridge_receives_the_status_and_each_note_once(inbox: Inbox, path: Path) -> None:
    received: list[dict[str, Any]] = []
    Link(str(path), received.append, lambda _: None)
    assert eventually(lambda: received)
    inbox.poll(WALKING._replace(notes=("a", "b"), policy="stand"))
    assert eventually(lambda: received[-1]["policy"] == "stand")
    assert [note for status in received for note in status["notes"]] == ["a", "b"]
    assert received[-1]["settings"]["step_height_m"] == [0.02, 0.1, 0.05]
    assert (received[-1]["gaits"], received[-1]["pose"]) == (["trot", "wave"], [1, 2, 0])


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_link_that_fails_to_read_counts_as_closed(path: Path) -> None:
    def fail(_: object) -> None:
        raise RuntimeError

    assert Link(str(path), fail, lambda _: None).closed.wait(5.0)


def test_a_run_waits_for_the_first_request_and_ends_after_silence(tmp_path: Path) -> None:
    inbox = Inbox(InboxConfig(still_after_s=0.2, lie_down_after_s=0.3))
    inbox.poll(WALKING)
    server = SteeringSocket(tmp_path / "steer", inbox, PathSource(inbox, "ros2", abilities), "ros2")
    link = Link(str(tmp_path / "steer"), lambda _: None, lambda _: None)
    end_s = time.monotonic() + 0.8
    while time.monotonic() < end_s:
        assert inbox.poll(WALKING).behaviour is Behaviour.WALK
        time.sleep(0.01)
    assert link.request(velocity=[0.1, 0, 0]) == ""
    assert eventually(lambda: inbox.poll(WALKING).behaviour is Behaviour.LIE_DOWN)
    server.close()


def test_a_lost_bridge_stops_steering_for_another(inbox: Inbox, paths: PathSource, path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as raw:
        raw.connect(str(path))
        raw.sendall(b'{"velocity": [0.2, 0, 0]}\n')
        assert eventually(lambda: inbox.poll(WALKING).velocity[0] == 0.2)
        raw.sendall(b'{"path": [[5, 2]], "goal": 1}\n')
        assert eventually(lambda: paths.state), "a walk along a path, which needs no more messages"
        assert paths.poll(WALKING).velocity[0] > 0.0
    assert eventually(lambda: paths.poll(WALKING).velocity[0] == 0.0), "before its silence counts"
    assert inbox.owner == ""
    assert "gone" in eventually(lambda: inbox.poll(WALKING).note)
    link = Link(str(path), lambda _: None, lambda _: None)
    assert link.request(velocity=[0.1, 0, 0]) == ""


def test_a_path_in_odom_is_walked_from_the_robots_position(paths: PathSource) -> None:
    """The robot moves exactly as commanded until the walk is over."""
    assert paths.follow([[2.0, 1.0], [2.0, 2.0], [1.0, 2.0]], math.pi / 2) == ""
    status = WALKING._replace(pose=Pose(1.0, 1.0, 2.5))
    for _ in range(3000):
        forward, leftward, yaw_rate = paths.poll(status).velocity
        x, y, yaw = status.pose
        step = STEP_S * complex(forward, leftward) * cmath.exp(1j * yaw)
        pose = Pose(x + step.real, y + step.imag, yaw + STEP_S * yaw_rate)
        status = status._replace(pose=pose, walking_s=status.walking_s + STEP_S)
        if paths.state.outcome:
            break
    assert (paths.state.outcome, paths.state.distance_m) == ("done", pytest.approx(0.0, abs=0.1))
    assert math.dist(status.pose[:2], (1.0, 2.0)) < 0.1
    assert math.remainder(status.pose.yaw_rad - math.pi / 2, 2 * math.pi) == pytest.approx(0.0, abs=0.1)
    assert paths.poll(status).velocity.tolist() == [0.0, 0.0, 0.0]


def test_velocities_other_than_zero_or_a_new_owner_end_the_walk(paths: PathSource, inbox: Inbox) -> None:
    paths.follow([[2.0, 0.0]])
    assert paths.poll(AT_START).velocity[0] > 0.0
    assert paths.put(velocity=[0.0, 0.0, 0.0]) == ""
    assert paths.poll(AT_START).velocity[0] > 0.0
    assert paths.put(velocity=[0.0, 0.1, 0.0]) == ""
    assert paths.state is None
    assert paths.poll(AT_START).velocity.tolist() == [0.0, 0.1, 0.0]
    paths.follow([[2.0, 0.0]])
    assert paths.poll(AT_START).velocity[0] > 0.0
    inbox.take_over("page")
    assert paths.poll(AT_START).velocity.tolist() == [0.0, 0.0, 0.0]
    assert "page" in paths.state.outcome
    assert paths.follow([[2.0, 0.0]]) != ""


def test_an_invalid_path_is_refused_in_one_line(paths: PathSource) -> None:
    for points in ([], "x", [[1]], [[math.nan, 0]], [[1e9, 0]], None, {"a": 1}, [[1, 2], "b"], 7):
        assert "\n" not in paths.follow(points) != "", points
        assert paths.state is None, points
    assert paths.follow([[1.0, 0.0]], "up") != ""
    assert paths.state is None


def test_without_odometry_the_walk_gives_up(paths: PathSource) -> None:
    paths.follow([[1.0, 0.0]])
    assert paths.poll(WALKING._replace(pose=UNKNOWN_POSE)).velocity.tolist() == [0.0, 0.0, 0.0]
    assert "odometry" in paths.state.outcome


def test_the_bridge_steers_and_reads_until_the_run_ends(inbox: Inbox, path: Path, tmp_path: Path) -> None:
    feed_path = tmp_path / "feed"
    with bridge(FAKE, feed_path, path, Ros2Config()):
        assert eventually(lambda: inbox.poll(WALKING).velocity[0] == 0.25)
        feed = Feed(listen(feed_path), {})  # a run makes it when it begins

        def result() -> bool:
            feed.put("/state", 0, messages.text("WALKING"))
            feed.serve()
            return inbox.poll(WALKING).note == "/state"

        assert eventually(result)
    assert eventually(lambda: inbox.owner == ""), "it ended with the run"


def test_a_bridge_that_fails_or_hangs_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    failing, hanging = (Ros2Config(arguments=(how,)) for how in ("fail", "hang"))
    with pytest.raises(UserError, match=r": the last line says why$"), bridge(FAKE, tmp_path, None, failing):
        pass
    monkeypatch.setattr("footfall.operate.ros2.bridge_process.START_S", 0.1)
    with pytest.raises(UserError), bridge(FAKE, tmp_path, None, hanging):
        pass


def test_height_scans_have_their_own_bridge(monkeypatch: pytest.MonkeyPatch) -> None:
    of_scans = Backend(sys.executable, "fake_scan_bridge", "no ROS")
    monkeypatch.setattr("footfall.operate.ros2.height_scans.find_backend", lambda config: of_scans)
    with scans_by_ros2() as (scans, warning):
        found = eventually(lambda: scans.newest(0))
    np.testing.assert_array_equal(found.heights, [-0.3, np.nan, 0.25])
    assert warning == ""


def test_a_python_without_ros_is_refused() -> None:
    with pytest.raises(UserError, match="rclpy"):
        find_backend(Ros2Config(python="/bin/false"))


def test_the_network_is_opened_on_request_only_and_with_a_warning() -> None:
    variable = "ROS_AUTOMATIC_DISCOVERY_RANGE"
    assert network_note(environment={}) == network_note(environment={variable: "localhost"}) == ""
    assert "control" in network_note(environment={variable: "SUBNET"})


def test_modules_run_by_ros_python_need_no_packages_of_footfall() -> None:
    """`-S` leaves out all installed packages."""
    modules = ("table", "link", "arguments", "reading", "throttle", "scan_sender")
    names = ", ".join(f"footfall.operate.ros2.{each}" for each in modules)
    command = [sys.executable, "-S", "-c", f"import {names}"]
    subprocess.run(command, check=True, env={"PYTHONPATH": str(ROOT / "src")})


def test_a_path_of_ros_ends_at_its_heading_and_if_refused_with_nav2s_code_for_an_unknown_error() -> None:
    """`rclpy` and `nav2_msgs` are replaced: Nav2's behaviour trees decide by this code."""
    modules = ("action", "node", "publisher", "qos", "task")
    ros: dict[str, Any] = {f"rclpy.{name}": MagicMock() for name in modules}
    ros |= {"rclpy": MagicMock(), "nav2_msgs": MagicMock()}
    ros["nav2_msgs.action"] = SimpleNamespace(FollowPath=MagicMock())
    ros["nav2_msgs.action"].FollowPath.Result.UNKNOWN = 100
    with patch.dict(sys.modules, ros):
        action = import_module("footfall.operate.ros2.rclpy_bridge.path_action")
        request = Mock(return_value="another operator steers")
        action.PathAction(MagicMock(), MagicMock(request=request))
    handle, last = MagicMock(), MagicMock()
    last.pose.orientation = SimpleNamespace(x=0.0, y=0.0, z=math.sin(0.35), w=math.cos(0.35))
    handle.request.path.poses = [MagicMock(), last]
    with pytest.raises(StopIteration) as ended:
        ros["rclpy.action"].ActionServer.call_args.kwargs["execute_callback"](handle).send(None)
    assert ended.value.value.error_code == 100
    assert request.call_args.kwargs["yaw_rad"] == pytest.approx(0.7)
