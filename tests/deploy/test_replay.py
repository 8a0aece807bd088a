"""Reading and repairing logs, with files written here record by record."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as PlainWriter
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
from footfall.deploy.telemetry.definitions import definition
from footfall.deploy.telemetry.topics import TOPICS
from footfall.policies.policy import PolicyInput, Sensed

ARRAY = "std_msgs/msg/Float64MultiArray"
ZEROS = np.zeros(12)


def inputs(time_s: float, joints: int = 12) -> PolicyInput:
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    sensed = Sensed(np.zeros(3), np.zeros(3), upright, *np.zeros((3, joints)))
    return PolicyInput(time_s, sensed, np.zeros(3), np.zeros(3), 0.3)


class Counts(Hold):
    """A policy whose target is 0.1 rad after a reset and 0.1 rad more at each step."""

    def reset(self, inputs: PolicyInput) -> None:
        super().reset(inputs)
        self.steps = 0

    def act(self, inputs: PolicyInput) -> JointCommand:
        self.steps += 1
        return JointCommand(ZEROS + 0.1 * self.steps, ZEROS, ZEROS, ZEROS, ZEROS)


def write_steps(path: Path, decisions: list[np.ndarray], steps: int, joints: Any = None) -> Path:
    """A log of these observations, and of commands for the first observations. `joints` None: go1's."""
    joints = list(load_robot("go1").joint_names) if joints is None else joints
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

        class Fails(Counts):
            def act(self, inputs: PolicyInput) -> JointCommand:
                raise ZeroDivisionError("by\nnought")

        nameless: list[Any] = [[], "text", [1, 2], {}]
        for decisions, steps, names, policy, named in (
            ([], 1, None, Counts, r"a\.mcap"),
            ([np.zeros(40)], 1, [f"joint{k}" for k in range(8)], Counts, "8 joints"),
            ([np.zeros(59)], 1, None, Counts, "59 .* 12 joints"),
            (decided(1), 1, None, Fails, "step 0: ZeroDivisionError: by"),
            *(([], 0, names, Counts, "joints") for names in nameless),
        ):
            path = write_steps(tmp_path / "a.mcap", decisions, steps, names)
            with pytest.raises(UserError, match=named):
                replay(path, policy(go1))

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
            name = writer.register_channel
            channels = [name(f"/t{k}", f"message {k}", schemas[k % 2], {"k": str(k)}) for k in range(3)]
            for k in range(7):
                writer.add_message(channels[k % 3], 100 + k, bytes([k]) * 50, 900 - k, 40 + 3 * k)
            writer.finish()
        whole = path.read_bytes()
        path.write_bytes(whole[: whole.rindex(bytes([6]) * 50)])  # the last message is lost
        return path

    def found(self, path: Path) -> Iterator[tuple]:
        with path.open("rb") as file:
            for schema, channel, message in make_reader(file).iter_messages():
                assert schema is not None
                yield (
                    (schema.name, schema.encoding, schema.data),
                    (channel.topic, channel.message_encoding, channel.metadata),
                    (message.log_time, message.publish_time, message.sequence, message.data),
                )

    def test_a_recovered_log_has_everything_before_the_damage(self, damaged: Path) -> None:
        whole = damaged.with_name("whole.mcap")
        assert recover(damaged, whole) == (6, 0)
        assert list(self.found(whole)) == [
            (
                (f"s{1 + k % 3 % 2}", f"encoding {1 + k % 3 % 2}", bytes([1 + k % 3 % 2])),
                (f"/t{k % 3}", f"message {k % 3}", {"k": str(k % 3)}),
                (100 + k, 900 - k, 40 + 3 * k, bytes([k]) * 50),
            )
            for k in range(6)
        ]
        with whole.open("rb") as file:
            reader = make_reader(file)
            header, summary = reader.get_header(), reader.get_summary()
            assert (header.profile, header.library) == ("ros2", "a library")
            assert [(m.name, m.metadata) for m in reader.iter_metadata()] == [("who", {"robot": "rex"})]
        assert summary is not None
        assert (len(summary.schemas), len(summary.channels)) == (2, 3)

    def test_paths_that_are_the_log_itself_unreadable_or_unwritable_are_refused(self, damaged: Path) -> None:
        link, before, absent = (
            damaged.with_name("link.mcap"),
            damaged.read_bytes(),
            damaged.with_name("absent"),
        )
        link.symlink_to(damaged)
        for log, copy in (
            *((damaged, name) for name in (damaged, link, damaged.parent / "." / damaged.name)),
            (damaged, absent / "whole.mcap"),
            (absent, damaged.with_name("whole.mcap")),
        ):
            with pytest.raises(UserError):
                recover(log, copy)
        assert damaged.read_bytes() == before
        assert not damaged.with_name("whole.mcap").exists()


# -- output ------------------------------------------------------------------------------------------


class Observing(Hold):
    """A policy with its own observation and action."""

    observed = np.array([1.5, 2.5, 3.5], dtype=np.float32)
    action = np.array([-0.5, 0.25], dtype=np.float32)


START_NS = 1_700_000_000_123_456_789


@pytest.fixture
def log(go1: Robot, tmp_path: Path) -> McapLog:
    (tmp_path / "run.mcap").write_bytes(b"an older and much longer file" * 10_000)
    facts = {"seed": 5, "policy": "by another name"}
    log = McapLog(tmp_path / "run.mcap", go1, Observing(go1), facts, may_wait=True)
    log.begin(START_NS)
    return log


def written(path: Path) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, record, message in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((record.log_time, message))
    return found


class TestWritten:
    def test_each_number_of_a_step_is_in_its_field(self, go1: Robot, log: McapLog, tmp_path: Path) -> None:
        n = np.arange(12.0)
        command = JointCommand(n, n + 100, n + 200, n + 300, n + 400)
        upright = np.array([1.0, 0.1, 0.2, 0.3])
        sensed = Sensed(np.array([1.0, 2, 3]), np.array([4.0, 5, 6]), upright, n + 1, n + 2, n + 3)
        seen = PolicyInput(0.75, sensed, np.array([0.1, 0.2, 0.3]), np.array([7.0, 8, 9]), 0.31)
        log.policy_step(1_500_000, seen, command, Observing(go1))
        log.note(1_600_000, "a note")
        log.order(1_700_000, Order(OrderKind.STOP, "page 2", "stopped by page 2"))
        log.close()
        found = written(tmp_path / "run.mcap")
        assert set(found) == {
            *("/cmd_vel", "/policy/inputs", "/policy/command", "/policy/observation", "/policy/action"),
            *("/notes", "/orders", "/rosout", "/robot_description", "/tf_static"),
        }
        at_ns = START_NS + 1_500_000_000
        steps = [topic for topic in found if topic.startswith("/policy/")]
        assert [found[topic][0][0] for topic in ("/cmd_vel", *steps)] == [at_ns] * 5
        inputs = [0.75, *range(1, 7), *upright, *(n + 1), *(n + 2), *(n + 3), 0.1, 0.2, 0.3, 7, 8, 9, 0.31]
        for topic, numbers in (
            ("/policy/inputs", inputs),
            ("/policy/command", np.concatenate(command)),
            ("/policy/observation", Observing.observed),
            ("/policy/action", Observing.action),
        ):
            message = found[topic][0][1]
            assert list(message.data) == list(numbers)
            (dimension,) = message.layout.dim
            assert (dimension.label, dimension.size) == (topic.rpartition("/")[2], len(numbers))
        twist = found["/cmd_vel"][0][1]
        assert (twist.header.stamp.sec, twist.header.stamp.nanosec) == (1_700_000_001, 623_456_789)
        assert (twist.twist.linear.x, twist.twist.linear.y, twist.twist.angular.z) == (0.1, 0.2, 0.3)
        assert found["/notes"][0][0] == START_NS + 1_600_000_000
        assert found["/notes"][0][1].data == "a note"
        stop = {"order": "stop", "by": "page 2", "why": "stopped by page 2"}
        assert json.loads(found["/orders"][0][1].data) == stop
        assert json.loads(found["/rosout"][-1][1].msg) == stop


NOT_OF_ROS = {"can_msgs/msg/Frame", "ros2_socketcan_msgs/msg/FdFrame"}


def test_definitions_equal_those_of_ros_2() -> None:
    """A tool decodes the bytes by its own definition, independently of the file's."""
    own_types, ros_types = get_typestore(Stores.EMPTY), get_typestore(Stores.ROS2_JAZZY)
    for kind in {topic.kind for topic in TOPICS.values()} - NOT_OF_ROS:
        found = get_types_from_msg(definition(kind), kind)
        own_types.register(found)
        assert all(own_types.hash_rihs01(each) == ros_types.hash_rihs01(each) for each in found), kind
