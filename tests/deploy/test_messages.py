"""A log's messages, byte by byte as the encoder of MCAP's ROS 2 library writes them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from mcap_ros2._dynamic import serialize_dynamic

from footfall.deploy.telemetry import messages
from footfall.deploy.telemetry.definitions import definition

TIMES = st.integers(0, 2**31 * 10**9 - 1)
NAMES = st.lists(st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=9), max_size=5)


def encoded(kind: str, message: dict) -> bytes:
    return serialize_dynamic(kind, definition(kind))[kind](message)


def header(time_ns: int, frame: str) -> dict:
    return {"stamp": {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}, "frame_id": frame}


@given(TIMES, NAMES, st.integers(0, 99))
def test_joint_states(time_ns: int, names: list[str], seed: int) -> None:
    numbers = np.random.default_rng(seed).normal(size=(3, len(names)))
    expected = {
        "header": header(time_ns, ""),
        "name": names,
        "position": numbers[0].tolist(),
        "velocity": numbers[1].tolist(),
        "effort": numbers[2].tolist(),
    }
    template = messages.joint_state(tuple(names))
    gaps = [row.tobytes() for row in numbers] if names else []
    assert template.fill(time_ns, *gaps) == encoded("sensor_msgs/msg/JointState", expected)
