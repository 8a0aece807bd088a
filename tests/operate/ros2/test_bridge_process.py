"""The bridge, a process with another Python: it receives the feed, ends with the run, reports a failure."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from import_in_process import ROOT
from walking_run import WALKING, abilities, eventually

from footfall.common.errors import UserError
from footfall.deploy.telemetry import messages
from footfall.deploy.telemetry.feed import Feed, listen
from footfall.operate.inbox import Inbox
from footfall.operate.ros2.bridge_process import Backend, Ros2Config, bridge, find_backend, network_note
from footfall.operate.ros2.height_scans import scans_by_ros2
from footfall.operate.ros2.path_source import PathSource
from footfall.operate.ros2.steering_socket import SteeringSocket

FAKE = Backend(sys.executable, "fake_bridge", "no ROS")


@pytest.fixture(autouse=True)
def finds_fake_bridge(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2] / "support"))


def test_the_bridge_steers_and_reads_the_feed_until_the_run_ends(tmp_path: Path) -> None:
    inbox, feed_path, steer_path = Inbox(), tmp_path / "feed", tmp_path / "steer"
    steering = SteeringSocket(steer_path, inbox, PathSource(inbox, "ros2", abilities), "ros2")
    with bridge(FAKE, feed_path, steer_path, Ros2Config()):
        assert eventually(lambda: inbox.poll(WALKING).velocity[0] == 0.25)
        feed = Feed(listen(feed_path), {})  # a run makes it when it begins

        def result() -> bool:
            feed.put("/state", 0, messages.text("WALKING"))
            feed.serve()
            return inbox.poll(WALKING).note == "/state"

        assert eventually(result)
    assert eventually(lambda: inbox.owner == ""), "it ended with the run"
    steering.close()


def test_a_bridge_that_fails_or_never_gets_ready_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
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
