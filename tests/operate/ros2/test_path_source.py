"""A path requested by ROS is walked by odometry; velocities of the same operator end it."""

import cmath
import math
from typing import Any

import pytest
from walking_run import WALKING, abilities

from footfall.deploy.command_source import UNKNOWN_POSE, Pose, Status
from footfall.operate.inbox import Inbox
from footfall.operate.ros2.path_source import PathSource

STEP_S = 0.02
AT_START = WALKING._replace(pose=Pose(0.0, 0.0, 0.0))


@pytest.fixture
def inbox() -> Inbox:
    inbox = Inbox()
    inbox.put("ros2", velocity=[0, 0, 0])
    return inbox


@pytest.fixture
def source(inbox: Inbox) -> PathSource:
    return PathSource(inbox, "ros2", abilities)


def walk(source: PathSource, begin: Pose) -> Status:
    """A point that moves exactly as commanded, until the walk is over."""
    status = WALKING._replace(pose=begin)
    for _ in range(3000):
        forward, leftward, yaw_rate = source.poll(status).velocity
        x, y, yaw = status.pose
        step = STEP_S * complex(forward, leftward) * cmath.exp(1j * yaw)
        pose = Pose(x + step.real, y + step.imag, yaw + STEP_S * yaw_rate)
        status = status._replace(pose=pose, walking_s=status.walking_s + STEP_S)
        if source.state is None or source.state.outcome:
            break
    return status


def test_a_path_in_odom_is_walked_from_the_robots_position(source: PathSource) -> None:
    assert source.follow([[2.0, 1.0], [2.0, 2.0], [1.0, 2.0]], math.pi / 2) == ""
    status = walk(source, Pose(1.0, 1.0, 2.5))
    assert (source.state.outcome, source.state.distance_m) == ("done", pytest.approx(0.0, abs=0.1))
    assert math.dist(status.pose[:2], (1.0, 2.0)) < 0.1
    assert math.remainder(status.pose.yaw_rad - math.pi / 2, 2 * math.pi) == pytest.approx(0.0, abs=0.1)
    assert source.poll(status).velocity.tolist() == [0.0, 0.0, 0.0]


def test_zero_velocities_do_not_end_the_walk_and_other_velocities_do(source: PathSource) -> None:
    source.follow([[2.0, 0.0]])
    assert source.poll(AT_START).velocity[0] > 0.0
    assert source.put(velocity=[0.0, 0.0, 0.0]) == ""
    assert source.poll(AT_START).velocity[0] > 0.0
    assert source.put(velocity=[0.0, 0.1, 0.0]) == ""
    assert source.state is None
    assert source.poll(AT_START).velocity.tolist() == [0.0, 0.1, 0.0]


def test_taking_over_ends_the_walk(source: PathSource, inbox: Inbox) -> None:
    source.follow([[2.0, 0.0]])
    assert source.poll(AT_START).velocity[0] > 0.0
    inbox.take_over("page")
    assert source.poll(AT_START).velocity.tolist() == [0.0, 0.0, 0.0]
    assert "page" in source.state.outcome
    assert source.follow([[2.0, 0.0]]) != ""


@pytest.mark.parametrize(
    "points", [[], "x", [[1]], [[math.nan, 0]], [[1e9, 0]], None, {"a": 1}, [[1, 2], "b"], 7]
)
def test_an_invalid_path_is_refused_in_one_line(source: PathSource, points: Any) -> None:
    assert "\n" not in source.follow(points) != ""
    assert source.follow([[1.0, 0.0]], "up") != ""
    assert source.state is None


def test_without_odometry_the_walk_gives_up(source: PathSource) -> None:
    source.follow([[1.0, 0.0]])
    assert source.poll(WALKING._replace(pose=UNKNOWN_POSE)).velocity.tolist() == [0.0, 0.0, 0.0]
    assert "odometry" in source.state.outcome
