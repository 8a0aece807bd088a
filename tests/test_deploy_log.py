"""Logs: what they hold, that a killed run keeps them, and that a replay finds the first difference."""

import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from deploy_policies import Hold, Spoilt, Sway, not_a_number, short_episode
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from footfall.common.errors import UserError
from footfall.deploy import messages
from footfall.deploy.log import McapLog, flatten, unflatten
from footfall.deploy.recover import recover
from footfall.deploy.replay import read_log, replay
from footfall.deploy.safety import Mode, State
from footfall.plant.episode import run_episode
from footfall.plant.trace import Trace
from footfall.policies.policy import Observation, Sensed
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot


@pytest.fixture(scope="module")
def logged(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Trace]:
    """The log of an orderly run of Sway, and its trace."""
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    policy = Sway(go1)
    return path, run_episode(go1, policy, short_episode(duration_s=0.5, seed=7, log=path))


class Decoded(NamedTuple):
    """One message as the indexed reader of MCAP's own library finds it."""

    topic: str
    kind: str
    message: Any


def decoded(path: Path, topic: str | None = None) -> list[Decoded]:
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        topics = None if topic is None else [topic]
        return [
            Decoded(channel.topic, schema.name, message)
            for schema, channel, _, message in reader.iter_decoded_messages(topics=topics)
        ]


class TestContent:
    def test_ros_tools_find_every_topic_with_its_type(self, logged: tuple[Path, Trace]) -> None:
        found = {m.topic: m.kind for m in decoded(logged[0])}
        network = {"/policy/observation", "/policy/action", "/notes"}  # Sway has no network, nothing to note
        assert found == {topic: kind for topic, kind in messages.TOPICS.items() if topic not in network}

    def test_policy_steps_are_all_there_and_readings_at_the_log_rate(
        self, logged: tuple[Path, Trace]
    ) -> None:
        path, trace = logged
        counts = Counter(m.topic for m in decoded(path))
        assert counts["/policy/inputs"] == len(trace.compute_ms) == 26
        assert counts["/joint_states"] == counts["/imu"] == pytest.approx(100 * trace.run_s, abs=2)

    def test_joint_states_carry_names_and_readings(self, go1: Robot, logged: tuple[Path, Trace]) -> None:
        last = decoded(logged[0], "/joint_states")[60].message
        assert last.name == list(go1.joint_names)
        np.testing.assert_allclose(last.position, go1.default_pose, atol=0.3)
        assert len(last.velocity) == len(last.effort) == 12

    def test_each_reading_stands_in_its_own_field(self, go1: Robot, tmp_path: Path) -> None:
        """Orientation comes as w x y z and is written by name."""
        position, velocity, torque, target = (100.0 * k + np.arange(12.0) for k in range(4))
        gyro, acceleration, quaternion = (
            np.array([1.0, 2, 3]),
            np.array([4.0, 5, 6]),
            np.array([0.1, 0.2, 0.3, 0.4]),
        )
        path = tmp_path / "tick.mcap"
        log = McapLog(path, go1, Hold(go1), every_us=10_000, facts={}, start_ns=0)
        log.tick(0, Sensed(gyro, acceleration, quaternion, position, velocity, torque), target)
        log.close()
        written = {each.topic: each.message for each in decoded(path)}
        joints, inertial = written["/joint_states"], written["/imu"]
        assert list(joints.position) == position.tolist()
        assert list(joints.velocity) == velocity.tolist()
        assert list(joints.effort) == torque.tolist()
        assert list(written["/joint_commands"].position) == target.tolist()
        assert [getattr(inertial.orientation, axis) for axis in "wxyz"] == quaternion.tolist()
        assert [getattr(inertial.angular_velocity, axis) for axis in "xyz"] == gyro.tolist()
        assert [getattr(inertial.linear_acceleration, axis) for axis in "xyz"] == acceleration.tolist()

    def test_states_come_in_order(self, logged: tuple[Path, Trace]) -> None:
        states = [m.message.data for m in decoded(logged[0], "/state")]
        assert states == ["STANDING", "WALKING", "RELEASING", "IDLE"]

    def test_a_fault_is_written_with_its_reason(self, go1: Robot, tmp_path: Path) -> None:
        path = tmp_path / "bad.mcap"
        run_episode(go1, Spoilt(go1, 0.1, not_a_number), short_episode(log=path))
        states = [m.message.data for m in decoded(path, "/state")]
        assert "ESTOP: the policy's command is not finite" in states

    def test_metadata_says_who_and_how(self, go1: Robot, logged: tuple[Path, Trace]) -> None:
        log = read_log(logged[0])
        assert log.complete
        assert log.metadata["policy"] == log.metadata["policy_spec"] == "sway"
        assert log.metadata["robot_digest"] == go1.digest
        assert log.metadata["seed"] == 7
        assert log.metadata["joints"] == list(go1.joint_names)

    def test_logging_does_not_change_the_run(self, go1: Robot, logged: tuple[Path, Trace]) -> None:
        again = run_episode(go1, Sway(go1), short_episode(duration_s=0.5, seed=7))
        assert np.array_equal(again.qpos, logged[1].qpos)


class TestKilledRun:
    SCRIPT = """
import sys
from pathlib import Path
from deploy_policies import Hold, short_episode
from footfall.plant.episode import run_episode
from footfall.robots.description import load_robot
from footfall.deploy.config import DeployConfig
from footfall.deploy.safety import SafetyConfig
robot = load_robot("go1")
patient = SafetyConfig(silence_timeout_s=5.0, pause_limit_s=5.0, skipped_share=1.0)
config = DeployConfig(motor_timeout_s=5.0, safety=patient)
episode = short_episode(duration_s=60.0, realtime=True, log=Path(sys.argv[1]), config=config)
run_episode(robot, Hold(robot), episode)
"""

    def test_keeps_all_but_its_last_moments(self, tmp_path: Path) -> None:
        path = tmp_path / "killed.mcap"
        environment = {"PYTHONPATH": f"{Path(__file__).parent}:{Path(__file__).parents[1]}"}
        process = subprocess.Popen([sys.executable, "-c", self.SCRIPT, str(path)], env=environment)
        try:
            deadline = time.monotonic() + 20.0
            while not path.exists() and time.monotonic() < deadline:
                time.sleep(0.05)
            time.sleep(2.5)
        finally:
            process.send_signal(signal.SIGKILL)
            process.wait()
        log = read_log(path)
        assert not log.complete
        assert log.metadata["policy"] == "hold"
        readings = [entry for entry in log.entries if entry.topic == "/joint_states"]
        assert (readings[-1].time_ns - readings[0].time_ns) * 1e-9 > 1.0

    def test_a_torn_file_can_be_replayed(
        self, go1: Robot, logged: tuple[Path, Trace], tmp_path: Path
    ) -> None:
        torn = tmp_path / "torn.mcap"
        whole = logged[0].read_bytes()
        torn.write_bytes(whole[: len(whole) * 9 // 10])
        assert not read_log(torn).complete
        assert not replay(torn, Sway(go1)).complete

    def test_a_torn_file_can_be_recovered_for_tools_that_need_an_index(
        self, logged: tuple[Path, Trace], tmp_path: Path
    ) -> None:
        torn, whole = tmp_path / "torn.mcap", tmp_path / "whole.mcap"
        content = logged[0].read_bytes()
        torn.write_bytes(content[: len(content) * 9 // 10])
        left = read_log(torn)
        assert recover(torn, whole) == len(left.entries) > 0
        assert len(decoded(whole)) == len(left.entries)
        again = read_log(whole)
        assert again.complete
        assert again.metadata == left.metadata


class TestReplay:
    def test_the_same_policy_decides_the_same_to_the_last_bit(
        self, go1: Robot, logged: tuple[Path, Trace]
    ) -> None:
        result = replay(logged[0], Sway(go1))
        assert result.steps == 26
        assert result.complete
        assert result.worst_difference == 0.0
        assert result.first_difference == ""

    def test_another_policy_is_told_apart_at_its_first_difference(
        self, go1: Robot, logged: tuple[Path, Trace]
    ) -> None:
        def lift(command: JointCommand) -> JointCommand:
            position = command.position.copy()
            position[4] += 0.5
            return command._replace(position=position)

        class Other(Sway):
            def act(self, observation: Observation) -> JointCommand:
                command = super().act(observation)
                return lift(command) if 0.19 < observation.time_s < 0.29 else command

        result = replay(logged[0], Other(go1))
        assert result.worst_difference == pytest.approx(0.5)
        assert result.first_difference.startswith("step 10 (0.200 s): position of FL_thigh_joint was ")

    def test_a_decision_that_is_no_number_any_more_is_a_difference(
        self, go1: Robot, logged: tuple[Path, Trace]
    ) -> None:
        class Undecided(Sway):
            def act(self, observation: Observation) -> JointCommand:
                command = super().act(observation)
                return not_a_number(command) if observation.time_s > 0.19 else command

        result = replay(logged[0], Undecided(go1), tolerance=1.0)
        assert result.first_difference.startswith("step 10 (0.200 s): torque of FR_hip_joint was 0, is nan")
        assert result.worst_difference == np.inf

    def test_a_decision_that_was_none_before_is_none_again(self, go1: Robot, tmp_path: Path) -> None:
        path = tmp_path / "bad.mcap"
        run_episode(go1, Spoilt(go1, 0.1, not_a_number), short_episode(log=path))
        assert replay(path, Spoilt(go1, 0.1, not_a_number)).first_difference == ""
        assert "was nan, is 0" in replay(path, Hold(go1)).first_difference

    @pytest.mark.parametrize("tolerance", [np.nan, np.inf, -1.0])
    def test_a_tolerance_that_tolerates_everything_or_nothing_is_refused(
        self, go1: Robot, logged: tuple[Path, Trace], tolerance: float
    ) -> None:
        with pytest.raises(UserError, match="tolerance"):
            replay(logged[0], Sway(go1), tolerance)

    def test_a_hand_written_observation_survives_the_log(self) -> None:
        n = np.arange(4.0)
        sensed = Sensed(n[:3], n[:3] + 1, n, n + 2, n + 3, n + 4)
        observation = Observation(0.5, sensed, n[:3], np.full(3, np.nan), np.nan)
        back = unflatten(flatten(observation))
        assert back.time_s == 0.5
        for one, other in zip(back.sensed, sensed, strict=True):
            assert np.array_equal(one, other)
        assert np.isnan(back.base_velocity).all()


class TestBadInput:
    def test_a_log_that_cannot_be_written_stops_the_run_before_it_starts(
        self, go1: Robot, tmp_path: Path
    ) -> None:
        policy = Hold(go1)
        with pytest.raises(UserError, match=r"cannot write the log .*folder\.mcap: No such file"):
            run_episode(go1, policy, short_episode(log=tmp_path / "no" / "such" / "folder.mcap"))
        assert not policy.seen

    @pytest.mark.parametrize("content", [b"", b"not an mcap at all", b"\x89MCAP0\r\n"])
    def test_what_is_no_log_is_refused(self, go1: Robot, tmp_path: Path, content: bytes) -> None:
        path = tmp_path / "bad.mcap"
        path.write_bytes(content)
        with pytest.raises(UserError, match=r"bad\.mcap is no"):
            replay(path, Hold(go1))

    def test_a_missing_log_is_named(self, go1: Robot, tmp_path: Path) -> None:
        with pytest.raises(UserError, match="cannot read the log"):
            replay(tmp_path / "none.mcap", Hold(go1))


def test_readings_are_apart_by_the_log_rate_also_after_a_pause(go1: Robot, tmp_path: Path) -> None:
    path = tmp_path / "pause.mcap"
    log = McapLog(path, go1, Hold(go1), every_us=10_000, facts={}, start_ns=0)
    still = Sensed(np.zeros(3), np.zeros(3), np.array([1.0, 0, 0, 0]), *np.zeros((3, 12)))
    for now_us in (0, 8_000, 45_000, 46_000, 54_000, 55_000):
        log.tick(now_us, still, np.zeros(12))
    log.state(60_000, State(Mode.ESTOP, 0.06, ("first", "second")))
    log.close()
    entries = read_log(path).entries
    assert [entry.time_ns for entry in entries if entry.topic == "/imu"] == [0, 45_000_000, 55_000_000]
    assert [entry.message.data for entry in entries if entry.topic == "/state"] == ["ESTOP: second"]
