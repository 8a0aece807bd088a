"""MCAP logs of a run, written outside the control loop's thread; ROS 2 tools open them.

A killed run keeps all but its last fraction of a second: the file is written in small chunks that are
flushed often, and `deploy/replay.py` reads files that lack their end.
"""

import json
import queue
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from footfall.common.config import unstructure
from footfall.common.errors import UserError
from footfall.deploy import messages
from footfall.deploy.safety import State
from footfall.policies.policy import Observation, Policy, Sensed
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

METADATA = "footfall"
CHUNK_BYTES = 64 * 1024
FLUSH_EVERY_S = 0.2


def flatten(observation: Observation) -> np.ndarray:
    """An observation as one float64 vector: time, the readings in field order, command, velocity, height."""
    return np.concatenate(
        [
            [observation.time_s],
            *observation.sensed,
            observation.command,
            observation.base_velocity,
            [observation.base_height],
        ]
    )


def unflatten(values: np.ndarray) -> Observation:
    """The observation that `flatten` made a vector of."""
    joints = (len(values) - 18) // 3
    sizes = [1, 3, 3, 4, joints, joints, joints, 3, 3, 1]
    time_s, *rest = np.split(values, np.cumsum(sizes)[:-1])
    *sensed, command, velocity, height = rest
    return Observation(float(time_s[0]), Sensed(*sensed), command, velocity, float(height[0]))


class McapLog:
    """Takes what the loop hands over and writes it from a thread of its own."""

    def __init__(
        self, path: Path, robot: Robot, policy: Policy, every_us: int, facts: dict[str, Any], start_ns: int
    ) -> None:
        """Open the file.

        Args:
            path: where to write; an older file is replaced.
            robot, policy: whom the log is about.
            every_us: shortest time between two logged readings.
            facts: further metadata, such as the seed.
            start_ns: Unix time of the loop's time zero, ns.

        Raises:
            UserError: the file cannot be written.
        """
        from mcap_ros2.writer import Writer

        self._path, self._policy = path, policy
        self._names = list(robot.joint_names)
        self._every_us, self._next_us, self._start_ns = every_us, 0, start_ns
        try:
            # a buffered file: the MCAP writer flushes it, and would wrap a raw one in a buffer of its own
            self._file = path.open("wb")
        except OSError as error:
            raise UserError(f"cannot write the log {path}: {error.strerror or error}") from None
        self._writer = Writer(self._file, chunk_size=CHUNK_BYTES)
        self._writer.add_metadata(METADATA, _metadata(robot, policy, facts))
        self._schemas = {
            name: self._writer.register_msgdef(name, text) for name, text in messages.SCHEMAS.items()
        }
        self._flush()
        self._queue: queue.SimpleQueue[tuple[str, int, tuple] | None] = queue.SimpleQueue()
        self._failure: Exception | None = None
        self._thread = threading.Thread(target=self._write_all, name="log", daemon=True)
        self._thread.start()

    # -- called by the loop --------------------------------------------------------------------------

    def tick(self, now_us: int, sensed: Sensed, target: np.ndarray) -> None:
        """Readings of a joint tick and the position targets that went out."""
        if now_us >= self._next_us:
            self._next_us = now_us + self._every_us
            self._queue.put(("tick", now_us, (sensed, target)))

    def policy_step(self, now_us: int, observation: Observation, command: JointCommand) -> None:
        """What the policy was handed and what it decided."""
        seen, action = getattr(self._policy, "observed", None), getattr(self._policy, "action", None)
        self._queue.put(("policy_step", now_us, (observation, command, seen, action)))

    def state(self, now_us: int, state: State) -> None:
        """A change of the supervisor's state."""
        self._queue.put(("state", now_us, (state,)))

    def note(self, now_us: int, note: str) -> None:
        """What had to be changed of what was asked for."""
        self._queue.put(("note", now_us, (note,)))

    def close(self) -> None:
        """Write what is left and the file's index.

        Raises:
            UserError: something could not be written, now or earlier.
        """
        self._queue.put(None)
        self._thread.join()
        if self._failure is not None:
            raise UserError(f"cannot write the log {self._path}: {self._failure}")

    # -- the writing thread --------------------------------------------------------------------------

    def _write_all(self) -> None:
        try:
            flushed = time.monotonic()
            while (item := self._queue.get()) is not None:
                kind, now_us, content = item
                getattr(self, f"_write_{kind}")(self._start_ns + now_us * 1000, *content)
                if time.monotonic() - flushed > FLUSH_EVERY_S:
                    self._flush()
                    flushed = time.monotonic()
            self._writer.finish()
        except Exception as error:  # reported by close(): the robot must not stop for its log
            self._failure = error
        finally:
            self._file.close()

    def _write_tick(self, time_ns: int, sensed: Sensed, target: np.ndarray) -> None:
        position, velocity, torque = (part.tolist() for part in sensed[3:])
        self._put(
            "/joint_states",
            time_ns,
            messages.joint_state(time_ns, self._names, position, velocity, torque),
        )
        self._put(
            "/joint_commands",
            time_ns,
            messages.joint_state(time_ns, self._names, target.tolist(), [], []),
        )
        inertial = messages.imu(
            time_ns, sensed.quaternion.tolist(), sensed.gyro.tolist(), sensed.acceleration.tolist()
        )
        self._put("/imu", time_ns, inertial)

    def _write_policy_step(
        self,
        time_ns: int,
        observation: Observation,
        command: JointCommand,
        seen: np.ndarray | None,
        action: np.ndarray | None,
    ) -> None:
        self._put("/cmd_vel", time_ns, messages.twist(time_ns, observation.command.tolist()))
        for topic, values in (
            ("/policy/inputs", flatten(observation)),
            ("/policy/command", np.concatenate(command)),
            ("/policy/observation", seen),
            ("/policy/action", action),
        ):
            if values is not None:
                label = topic.rpartition("/")[2]
                self._put(topic, time_ns, messages.multi_array(values.tolist(), label))

    def _write_state(self, time_ns: int, state: State) -> None:
        self._put("/state", time_ns, {"data": ": ".join([state.mode.value, *state.faults[-1:]])})

    def _write_note(self, time_ns: int, note: str) -> None:
        self._put("/notes", time_ns, {"data": note})

    def _put(self, topic: str, time_ns: int, message: dict) -> None:
        self._writer.write_message(topic, self._schemas[messages.TOPICS[topic]], message, time_ns)

    def _flush(self) -> None:
        self._writer._writer.flush()  # the ROS 2 wrapper does not offer it


def _metadata(robot: Robot, policy: Policy, facts: dict[str, Any]) -> dict[str, str]:
    contract = policy.contract
    content: dict[str, Any] = {
        "policy": policy.name,
        "policy_rate_hz": policy.rate_hz,
        "robot": robot.name,
        "robot_folder": str(robot.folder),
        "robot_digest": robot.digest,
        "joints": list(robot.joint_names),
        "contract": None if contract is None else unstructure(contract),
        **facts,
    }
    return {key: json.dumps(value) for key, value in content.items()}
