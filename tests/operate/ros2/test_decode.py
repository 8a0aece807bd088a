"""Decoding of messages from bytes, without ROS."""

import struct

import pytest

from footfall.deploy.telemetry.messages import Template, multi_array
from footfall.operate.ros2.cyclone_bridge.decode import decode
from footfall.operate.ros2.table import HEIGHT_SCAN, TWIST, TWIST_STAMPED

SIX = struct.pack("<6d", 0.5, -0.2, 9.0, 9.0, 9.0, 0.3)
TEXT, NUMBER = "std_msgs/msg/String", "std_msgs/msg/Float64"
NUMBERS = HEIGHT_SCAN.kind


@pytest.mark.parametrize("frame", ["", "a", "base_link", "base_link_"])
def test_velocities_follow_frame_names_of_any_length(frame: str) -> None:
    assert decode(TWIST, Template().gap(6).fill(0, SIX)) == [0.5, -0.2, 0.3]
    assert decode(TWIST_STAMPED, Template().stamp(frame).gap(6).fill(7, SIX)) == [0.5, -0.2, 0.3]


def test_texts_and_numbers_are_decoded_in_either_byte_order() -> None:
    assert decode(TEXT, Template().text("wave").fill(0)) == "wave"
    assert decode(NUMBER, b"\0\1\0\0" + struct.pack("<d", 0.08)) == 0.08
    assert decode(NUMBER, b"\0\0\0\0" + struct.pack(">d", 0.08)) == 0.08
    assert decode("std_msgs/msg/Empty", b"\0\1\0\0\0") is None


@pytest.mark.parametrize("label", ["", "row", "points"])
def test_numbers_follow_labels_of_any_length(label: str) -> None:
    three = struct.pack("<3f", 0.5, -0.25, 1.0)
    assert decode(NUMBERS, multi_array(label, 3, 4).fill(0, three)) == [0.5, -0.25, 1.0]


@pytest.mark.parametrize("kind", [TWIST, TWIST_STAMPED, TEXT, NUMBER, NUMBERS])
@pytest.mark.parametrize("message", [b"", b"\0\1\0\0", b"\0\1\0\0\xff\xff\xff", b"\0\1\0\0" + b"\xff" * 7])
def test_bytes_without_a_message_are_refused(kind: str, message: bytes) -> None:
    with pytest.raises(ValueError):  # noqa: PT011
        decode(kind, message)
