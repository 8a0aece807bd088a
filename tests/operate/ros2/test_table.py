"""The names in ROS: complete, unique, and valid in ROS."""

import re

import pytest

from footfall.deploy.telemetry.topics import TOPICS
from footfall.operate.ros2.table import (
    CHOICES,
    FOLLOW_PATH,
    PUBLISHED,
    SERVICES,
    SUBSCRIBED,
    WAVE,
    absolute,
    in_name,
)
from footfall.operate.ros2.throttle import Throttle

PARTS = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")  # of a ROS 2 name


def test_names_are_valid_in_ros_and_unique() -> None:
    topics = [absolute(each.name.format("trot")) for each in (*PUBLISHED, *SUBSCRIBED)]
    offered = (*SERVICES, *CHOICES.values(), WAVE, FOLLOW_PATH)
    services = [absolute(each.name.format("trot")) for each in offered]
    assert all(map(PARTS.fullmatch, [*topics, *services]))
    assert len(set(topics)) == len(topics)
    assert len(set(services)) == len(services)


def test_all_published_topics_are_in_the_feed() -> None:
    assert {each.feed for each in PUBLISHED} <= set(TOPICS)


@pytest.mark.parametrize("text", ["trot", "go1-flat", "trot@kp=90", "3 legs", "runs/näher"])
def test_any_policy_name_becomes_part_of_a_ros_name(text: str) -> None:
    assert PARTS.fullmatch(f"/{in_name(text)}")


def test_a_throttle_keeps_the_mean_rate() -> None:
    """Of 500 Hz, 200 Hz and 50 Hz pass; after a pause there is no burst."""
    for rate_hz in (200.0, 50.0, float("inf")):
        throttle = Throttle(rate_hz)
        passed = sum(throttle.due(10**18 + tick * 2_000_000) for tick in range(500))
        assert passed == pytest.approx(min(rate_hz, 500.0), abs=1)
        later = 2 * 10**18
        assert [throttle.due(later), throttle.due(later + 1)] == [True, rate_hz == float("inf")]
