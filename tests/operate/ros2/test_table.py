"""Names in ROS: complete, unique and valid; messages decoded from bytes without ROS."""

import re
import struct

import pytest

from footfall.deploy.telemetry.messages import Template, multi_array
from footfall.deploy.telemetry.topics import TOPICS
from footfall.operate.ros2 import table
from footfall.operate.ros2.cyclone_bridge.decode import decode
from footfall.operate.ros2.table import HEIGHT_SCAN, TWIST, TWIST_STAMPED, absolute, in_name
from footfall.operate.ros2.throttle import Throttle

NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")  # an absolute name of ROS 2


def test_names_are_valid_in_ros_unique_and_published_topics_are_in_the_feed() -> None:
    topics = [absolute(each.name.format("trot")) for each in (*table.PUBLISHED, *table.SUBSCRIBED)]
    offered = (*table.SERVICES, *table.CHOICES.values(), table.WAVE, table.FOLLOW_PATH)
    services = [absolute(each.name.format("trot")) for each in offered]
    assert all(map(NAME.fullmatch, [*topics, *services]))
    assert (len(set(topics)), len(set(services))) == (len(topics), len(services))
    assert {each.feed for each in table.PUBLISHED} <= set(TOPICS)
    for policy in ("trot", "go1-flat", "trot@kp=90", "3 legs", "runs/näher"):
        assert NAME.fullmatch(f"/{in_name(policy)}")


def test_a_throttle_keeps_the_mean_rate() -> None:
    """Messages arrive at 500 Hz; at most `rate_hz` pass. After a pause there is no burst."""
    for rate_hz in (200.0, 50.0, float("inf")):
        throttle = Throttle(rate_hz)
        passed = sum(throttle.due(10**18 + tick * 2_000_000) for tick in range(500))
        assert passed == pytest.approx(min(rate_hz, 500.0), abs=1)
        later = 2 * 10**18
        assert [throttle.due(later), throttle.due(later + 1)] == [True, rate_hz == float("inf")]


TEXT, NUMBER, NUMBERS = "std_msgs/msg/String", "std_msgs/msg/Float64", HEIGHT_SCAN.kind


@pytest.mark.parametrize("name", ["", "a", "row", "base_link", "base_link_"])
def test_numbers_follow_frame_names_and_labels_of_any_length(name: str) -> None:
    six, three = struct.pack("<6d", 0.5, -0.2, 9.0, 9.0, 9.0, 0.3), struct.pack("<3f", 0.5, -0.25, 1.0)
    assert decode(TWIST, Template().gap(6).fill(0, six)) == [0.5, -0.2, 0.3]
    assert decode(TWIST_STAMPED, Template().stamp(name).gap(6).fill(7, six)) == [0.5, -0.2, 0.3]
    assert decode(NUMBERS, multi_array(name, 3, 4).fill(0, three)) == [0.5, -0.25, 1.0]


def test_texts_and_numbers_are_decoded_in_either_byte_order() -> None:
    assert decode(TEXT, Template().text("wave").fill(0)) == "wave"
    assert decode(NUMBER, b"\0\1\0\0" + struct.pack("<d", 0.08)) == 0.08
    assert decode(NUMBER, b"\0\0\0\0" + struct.pack(">d", 0.08)) == 0.08
    assert decode("std_msgs/msg/Empty", b"\0\1\0\0\0") is None


@pytest.mark.parametrize("kind", [TWIST, TWIST_STAMPED, TEXT, NUMBER, NUMBERS])
@pytest.mark.parametrize("message", [b"", b"\0\1\0\0", b"\0\1\0\0\xff\xff\xff", b"\0\1\0\0" + b"\xff" * 7])
def test_bytes_without_a_message_are_refused(kind: str, message: bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        decode(kind, message)
