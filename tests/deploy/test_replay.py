"""Writing, reading and repairing logs: fields, decisions again, damaged files, bytes of ROS 2."""

import json
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from deploy_policies import Hold
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as PlainWriter
from mcap_ros2._dynamic import serialize_dynamic
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from footfall import JointCommand, Robot, UserError, load_robot
from footfall.deploy.log import McapLog
from footfall.deploy.log_numbers import flatten
from footfall.deploy.log_records import Kind, record
from footfall.deploy.orders import Order, OrderKind
from footfall.deploy.recover import recover
from footfall.deploy.replay import replay
from footfall.deploy.telemetry import messages
from footfall.deploy.telemetry.definitions import definition
from footfall.deploy.telemetry.topics import TOPICS
from footfall.policies.policy import PolicyInput, Sensed

ARRAY = "std_msgs/msg/Float64MultiArray"
GO1 = load_robot("go1").joint_names
ZEROS = np.zeros(12)


def inputs(time_s: float, joints: int = 12) -> PolicyInput:
    sensed = Sensed(*np.zeros((2, 3)), np.eye(4)[0], *np.zeros((3, joints)))
    return PolicyInput(time_s, sensed, np.zeros(3), np.zeros(3), 0.3)


class Counts(Hold):
    """A policy whose target is 0.1 rad after a reset and 0.1 rad more at each step."""

    def reset(self, inputs: PolicyInput) -> None:
        super().reset(inputs)
        self.steps = 0

    def act(self, inputs: PolicyInput) -> JointCommand:
        self.steps += 1
        return JointCommand(ZEROS + 0.1 * self.steps, ZEROS, ZEROS, ZEROS, ZEROS)


def write_steps(path: Path, decisions: list[np.ndarray], steps: int, joints: Any = GO1) -> Path:
    """A log of this number of observations, and of commands for the first ones."""
    with path.open("wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef(ARRAY, definition(ARRAY))
        writer.add_metadata("somebody else's", {"robot": "not JSON"})
        writer.add_metadata("footfall", {"joints": json.dumps(joints), "ended": "true"})
        for step in range(steps):
            values = [("/policy/inputs", flatten(inputs(0.02 * step, len(joints))))]
            values += [("/policy/command", decisions[step])] if step < len(decisions) else []
            for topic, numbers in values:
                message = {"layout": {"dim": [], "data_offset": 0}, "data": numbers.tolist()}
                writer.write_message(topic, schema, message, 1000 + step, 7)
        writer.finish()
    return path


def decided(steps: int, *changes: tuple[int, int, float]) -> list[np.ndarray]:
    """Decisions of `Counts`, with some numbers changed: (step, index, by)."""
    numbers = [np.concatenate([ZEROS + 0.1 * (step + 1), np.zeros(48)]) for step in range(steps)]
    for step, index, by in changes:
        numbers[step][index] += by
    return numbers


class TestReplay:
    def test_the_first_and_the_worst_difference_are_found(self, go1: Robot, tmp_path: Path) -> None:
        """The differences are 0.25 at step 1, 2.0 at step 2 and 0.5 at step 3, and infinite for NaN."""
        changes = (1, 17, -0.25), (1, 3, 0.125), (2, 59, 2.0), (3, 0, 0.5)
        path = write_steps(tmp_path / "a.mcap", decided(5, *changes), 5)
        for tolerance, step in ((0.0, "step 1"), (0.2499, "step 1"), (0.25, "step 2"), (2.0, "")):
            result = replay(path, Counts(go1), tolerance)
            assert result.first_difference.partition(" (")[0] == step
            assert result.worst_difference == pytest.approx(2.0)
        first = replay(path, Counts(go1)).first_difference
        assert all(part in first for part in ("0.020 s", "velocity", "FL_calf_joint", "-0.25"))
        path = write_steps(tmp_path / "b.mcap", decided(2, (1, 4, np.nan)), 2)
        assert replay(path, Counts(go1), tolerance=10.0).worst_difference == np.inf

    def test_unfit_logs_and_failing_policies_are_refused(self, go1: Robot, tmp_path: Path) -> None:
        """The logs have no decisions, another robot, no joint names, or too few numbers."""
        rows: list[tuple[list[np.ndarray], int, Any, str]] = [
            ([], 1, GO1, r"a\.mcap"),
            ([np.zeros(40)], 1, [f"joint{k}" for k in range(8)], "8 joints"),
            ([np.zeros(59)], 1, GO1, "59 .* 12 joints"),
            *(([], 0, names, "joints") for names in ([], "text", [1, 2], {})),
        ]
        for decisions, steps, names, named in rows:
            path = write_steps(tmp_path / "a.mcap", decisions, steps, names)
            with pytest.raises(UserError, match=named):
                replay(path, Counts(go1))
        fails = Counts(go1)
        fails.act = Mock(side_effect=ZeroDivisionError("by\nnought"))  # type: ignore[method-assign]
        with pytest.raises(UserError, match="step 0: ZeroDivisionError: by"):
            replay(write_steps(path, decided(1), 1), fails)

    def test_decisions_are_compared_by_time(self, go1: Robot, tmp_path: Path) -> None:
        """A damaged part of a log may have contained only the observation or only the command."""
        path = tmp_path / "gap.mcap"
        log = McapLog(path, go1, Hold(go1), {}, may_wait=True)
        log.begin(0)
        decisions = [JointCommand(*numbers.reshape(5, 12)) for numbers in decided(3)]
        log.policy_step(0, inputs(0.0), decisions[0], Hold(go1))
        log._put(record(Kind.INPUTS, 20_000, flatten(inputs(0.02)).tobytes()))
        log.policy_step(40_000, inputs(0.04), decisions[1], Hold(go1))
        log.close()
        assert replay(path, Counts(go1)).first_difference == ""


class TestRecover:
    """Repaired logs, read by MCAP's own reader."""

    @pytest.fixture
    def damaged(self, tmp_path: Path) -> Path:
        """A log without an end: two schemas, three channels, messages whose times and numbers all differ."""
        path = tmp_path / "damaged.mcap"
        with path.open("wb") as file:
            writer = PlainWriter(file, chunk_size=1, compression=CompressionType.NONE)
            writer.start("ros2", "a library")
            writer.add_metadata("who", {"robot": "rex"})
            schemas = [writer.register_schema(f"s{k}", f"encoding {k}", bytes([k])) for k in (1, 2)]
            for k in range(3):
                writer.register_channel(f"/t{k}", f"message {k}", schemas[k % 2], {"k": str(k)})
            for k in range(7):
                writer.add_message(1 + k % 3, 100 + k, bytes([k]) * 50, 900 - k, 40 + 3 * k)
            writer.finish()
        whole = path.read_bytes()
        path.write_bytes(whole[: whole.rindex(bytes([6]) * 50)])  # the last message is lost
        return path

    def test_a_recovered_log_has_everything_before_the_damage(self, damaged: Path) -> None:
        whole = damaged.with_name("whole.mcap")
        assert recover(damaged, whole) == (6, 0)
        with whole.open("rb") as file:
            reader = make_reader(file)
            for k, (schema, channel, message) in enumerate(reader.iter_messages()):
                c, s = k % 3, 1 + k % 3 % 2
                assert (schema.name, schema.encoding, schema.data) == (f"s{s}", f"encoding {s}", bytes([s]))
                assert (channel.topic, channel.message_encoding) == (f"/t{c}", f"message {c}")
                times = message.log_time, message.publish_time, message.sequence
                assert (channel.metadata, times) == ({"k": str(c)}, (100 + k, 900 - k, 40 + 3 * k))
                assert message.data == bytes([k]) * 50
            header, summary = reader.get_header(), reader.get_summary()
            assert (header.profile, header.library) == ("ros2", "a library")
            assert [(m.name, m.metadata) for m in reader.iter_metadata()] == [("who", {"robot": "rex"})]
        assert (k, len(summary.schemas), len(summary.channels)) == (5, 2, 3)

    def test_paths_that_are_the_log_itself_unreadable_or_unwritable_are_refused(self, damaged: Path) -> None:
        before, folder = damaged.read_bytes(), damaged.parent
        link, absent, whole = (folder / name for name in ("link.mcap", "absent", "whole.mcap"))
        link.symlink_to(damaged)
        copies = damaged, link, folder / "." / damaged.name, absent / "whole.mcap"
        for log, copy in (*((damaged, copy) for copy in copies), (absent, whole)):
            with pytest.raises(UserError):
                recover(log, copy)
        assert damaged.read_bytes() == before
        assert not whole.exists()


def test_each_number_of_a_step_is_in_its_field(go1: Robot, tmp_path: Path) -> None:
    """The log replaces an older and longer file."""
    path, start_ns = tmp_path / "run.mcap", 1_700_000_000_123_456_789
    path.write_bytes(b"an older and much longer file" * 10_000)
    policy: Any = Hold(go1)
    policy.observed = np.array([1.5, 2.5, 3.5], dtype=np.float32)
    policy.action = np.array([-0.5, 0.25], dtype=np.float32)
    log = McapLog(path, go1, policy, {"seed": 5, "policy": "by another name"}, may_wait=True)
    log.begin(start_ns)
    n = np.arange(12.0)
    command = JointCommand(n, n + 100, n + 200, n + 300, n + 400)
    upright = np.array([1.0, 0.1, 0.2, 0.3])
    sensed = Sensed(np.array([1.0, 2, 3]), np.array([4.0, 5, 6]), upright, n + 1, n + 2, n + 3)
    seen = PolicyInput(0.75, sensed, np.array([0.1, 0.2, 0.3]), np.array([7.0, 8, 9]), 0.31)
    log.policy_step(1_500_000, seen, command, policy)
    log.note(1_600_000, "a note")
    log.order(1_700_000, Order(OrderKind.STOP, "page 2", "stopped by page 2"))
    log.close()
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, entry, message in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((entry.log_time, message))
    inputs = [0.75, *range(1, 7), *upright, *(n + 1), *(n + 2), *(n + 3), 0.1, 0.2, 0.3, 7, 8, 9, 0.31]
    expected = {
        "/policy/inputs": inputs,
        "/policy/command": np.concatenate(command),
        "/policy/observation": policy.observed,
        "/policy/action": policy.action,
    }
    others = {"/cmd_vel", "/notes", "/orders", "/rosout", "/robot_description", "/tf_static"}
    assert set(found) == {*expected, *others}
    for topic, numbers in expected.items():
        time_ns, message = found[topic][0]
        assert time_ns == found["/cmd_vel"][0][0] == start_ns + 1_500_000_000
        assert list(message.data) == list(numbers)
        (dimension,) = message.layout.dim
        assert (dimension.label, dimension.size) == (topic.rpartition("/")[2], len(numbers))
    twist = found["/cmd_vel"][0][1]
    assert (twist.header.stamp.sec, twist.header.stamp.nanosec) == (1_700_000_001, 623_456_789)
    assert (twist.twist.linear.x, twist.twist.linear.y, twist.twist.angular.z) == (0.1, 0.2, 0.3)
    time_ns, note = found["/notes"][0]
    assert (time_ns, note.data) == (start_ns + 1_600_000_000, "a note")
    stop = {"order": "stop", "by": "page 2", "why": "stopped by page 2"}
    assert json.loads(found["/orders"][0][1].data) == json.loads(found["/rosout"][-1][1].msg) == stop


@given(
    st.integers(0, 2**31 * 10**9 - 1),
    st.lists(st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=9), max_size=5),
    st.integers(0, 99),
)
def test_joint_states_are_the_bytes_of_mcaps_ros_2_library(time_ns: int, names: list[str], seed: int) -> None:
    kind, numbers = "sensor_msgs/msg/JointState", np.random.default_rng(seed).normal(size=(3, len(names)))
    expected = {
        "header": {"stamp": {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}, "frame_id": ""},
        "name": names,
        **dict(zip(("position", "velocity", "effort"), numbers.tolist(), strict=True)),
    }
    gaps = [row.tobytes() for row in numbers] if names else []
    encoded = serialize_dynamic(kind, definition(kind))[kind](expected)
    assert messages.joint_state(tuple(names)).fill(time_ns, *gaps) == encoded


def test_definitions_equal_those_of_ros_2() -> None:
    """A tool decodes the bytes by its own definition, independently of the file's."""
    own_types, ros_types = get_typestore(Stores.EMPTY), get_typestore(Stores.ROS2_JAZZY)
    foreign = {"can_msgs/msg/Frame", "ros2_socketcan_msgs/msg/FdFrame"}
    for kind in {topic.kind for topic in TOPICS.values()} - foreign:
        found = get_types_from_msg(definition(kind), kind)
        own_types.register(found)
        assert all(own_types.hash_rihs01(each) == ros_types.hash_rihs01(each) for each in found), kind
