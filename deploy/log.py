"""Log of a run, written by another process to an MCAP file and to subscribers of a feed.

The loop writes records to a pipe and never waits for the disk or a subscriber. Records in the pipe outlive
the loop. If both processes are killed, the log lacks the last fraction of a second.
"""

import json
import math
import os
import stat
import struct
import subprocess
import sys
from contextlib import ExitStack, suppress
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np

from footfall.common.config import unstructure
from footfall.common.errors import UserError
from footfall.common.locks import locked
from footfall.deploy.battery import BatteryState
from footfall.deploy.changes import Change
from footfall.deploy.estimation.odometry import Odometry
from footfall.deploy.frames import Frames
from footfall.deploy.log_numbers import flatten, input_sizes, odometry_numbers
from footfall.deploy.log_records import FD_FRAME, FRAME, START, Kind, record
from footfall.deploy.log_store import LogStore, lock_name
from footfall.deploy.orders import Order
from footfall.deploy.receiver import MotorHealth
from footfall.deploy.safety import State
from footfall.deploy.telemetry.feed import listen
from footfall.deploy.telemetry.process import NONE, READY
from footfall.deploy.telemetry.robot_frames import robot_frames
from footfall.deploy.wiring import wiring_of
from footfall.policies.live_settings import Applied
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.readings import sensed_sizes

FD_KINDS = {Kind.RECEIVED: Kind.RECEIVED_FD, Kind.SENT: Kind.SENT_FD}
MAX_WAITING_BYTES = 4 * 2**20  # buffer for a slow disk: some seconds of a run
LAST_WAIT_S = 10.0  # wait for the writing process at the end of the run


class McapLog:
    """Sends a run's records to a process that writes them to a log, to subscribers, or to both."""

    def __init__(
        self,
        path: Path | None,
        robot: Robot,
        policy: Policy,
        facts: dict[str, Any],
        may_wait: bool,
        feed: Path | None = None,
        store: LogStore | None = None,
    ) -> None:
        """Open the file and the feed, and start the process.

        Args:
            path: log file to write; an older file is replaced. None for no log.
            robot, policy: robot and policy of the run.
            facts: further metadata, such as the seed.
            may_wait: let the loop wait for a slow disk; otherwise records are dropped, and counted.
            feed: socket for subscribers, see `telemetry/feed.py`; None for no feed.
            store: store of the log; the log is then written in parts, and old logs are deleted for space.

        Raises:
            UserError: the file cannot be written, the feed cannot be served, or another run uses one of them.
        """
        self._target = f"the feed {feed}" if path is None else f"the log {path}"
        self._may_wait = may_wait
        self._locks = ExitStack()
        try:
            with ExitStack() as opened:
                listener = None if feed is None else self._listen(feed, opened)
                file = None if path is None else self._open(path, opened)
                self._process = _start(file, listener)
        except OSError as error:
            self._locks.close()
            raise UserError(f"cannot write {self._target}: {error.strerror or error}") from None
        except UserError:
            self._locks.close()
            raise
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        if self._process.stdout.readline().strip() != READY.encode():
            self._locks.close()
            raise UserError(f"cannot write {self._target}: the process that writes it does not start")
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, may_wait)
        self._waiting = bytearray()
        self._dropped = 0
        self._health: tuple[bytes, ...] | None = None  # latest written state
        self._battery: BatteryState | None = None  # latest written state
        self._broken = False
        self._missing_parts: str | None = None
        self._begun = False
        first_record = {
            "joints": list(robot.joint_names),
            "readings": sensed_sizes(len(robot.joint_names), robot.foot_sensors),
            "inputs": input_sizes(len(robot.joint_names), robot.foot_sensors),
            "metadata": _metadata(robot, policy, facts),
            **robot_frames(robot),
            "robot": robot.name,
            "robot_folder": str(robot.folder),
            "robot_digest": robot.digest,
            "buses": list(wiring_of(robot).buses),
            "paced": not may_wait,
            "store": None if store is None else [str(store.folder), store.max_bytes],
            "path": None if path is None else str(path),
        }
        self._first_record = json.dumps(first_record).encode()

    def _open(self, path: Path, opened: ExitStack) -> int:
        """Descriptor of a log's file, locked against other runs."""
        file = opened.enter_context(os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT, 0o666), "wb"))
        if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
            self._locks.enter_context(locked(lock_name(path), f"the log {path}"))
            file.truncate()
        return file.fileno()

    def _listen(self, feed: Path, opened: ExitStack) -> int:
        """Descriptor of a feed's listening socket."""
        listener = opened.enter_context(listen(feed))
        self._locks.callback(feed.unlink, missing_ok=True)
        return listener.fileno()

    # -- called by the loop --------------------------------------------------------------------------

    def begin(self, start_ns: int) -> None:
        """Start the log; called first. `start_ns` is the Unix time of time zero, ns."""
        self._begun = True
        self._put(record(Kind.BEGIN, 0, START.pack(start_ns) + self._first_record))

    def tick(self, now_us: int, sensed: Sensed, motors: MotorHealth, commanded: np.ndarray | None) -> None:
        """Log the readings of a joint tick, and the sent command (5, n); None if none was sent.

        The motors' health is logged after a change.
        """
        records = record(Kind.READINGS, now_us, np.concatenate(sensed).tobytes())
        records += record(Kind.AGES, now_us, motors.age_s.tobytes())
        health = motors.temperature_c.tobytes(), motors.voltage.tobytes(), motors.error.tobytes()
        if health != self._health:
            self._health = health
            records += record(Kind.HEALTH, now_us, np.concatenate(motors[1:]).tobytes())
        if commanded is not None:
            records += record(Kind.COMMANDED, now_us, commanded.tobytes())
        self._put(records)

    def policy_step(self, now_us: int, inputs: PolicyInput, command: JointCommand, policy: Policy) -> None:
        """Log inputs and decision of a policy step; `policy` is the current policy."""
        records = record(Kind.INPUTS, now_us, flatten(inputs).tobytes())
        records += record(Kind.DECISION, now_us, np.concatenate(command).tobytes())
        for kind, name in ((Kind.OBSERVATION, "observed"), (Kind.ACTION, "action")):
            values = getattr(policy, name, None)
            if values is not None:
                records += record(kind, now_us, np.asarray(values, dtype=np.float32).tobytes())
        self._put(records)

    def change(self, now_us: int, change: Change) -> None:
        """Log a change of policy, gait or settings, effective from this policy step on."""
        self._put(record(Kind.CHANGE, now_us, change.to_json().encode()))

    def applied(self, now_us: int, applied: Applied) -> None:
        """Log gait and live settings of the current policy."""
        self._put(record(Kind.APPLIED, now_us, json.dumps(applied._asdict()).encode()))

    def order(self, now_us: int, order: Order) -> None:
        """Log an operator's order."""
        self._put(record(Kind.ORDER, now_us, order.to_json().encode()))

    def odometry(self, now_us: int, odometry: Odometry, footholds: np.ndarray | None = None) -> None:
        """Log the estimated motion of the base, and the footholds of a policy that plans them, (feet, 3)
        m."""
        records = record(Kind.ODOMETRY, now_us, odometry_numbers(odometry).tobytes())
        records += record(Kind.CONTACTS, now_us, odometry.contact.tobytes())
        if footholds is not None:
            records += record(Kind.FOOTHOLDS, now_us, footholds.tobytes())
        self._put(records)

    def battery(self, now_us: int, battery: BatteryState) -> None:
        """Log the battery's state after a change, once its voltage is known."""
        if battery is self._battery or math.isnan(battery.voltage_v):
            return
        self._battery = battery
        numbers = struct.pack("<3d", battery.voltage_v, -battery.current_a, battery.charge)
        self._put(record(Kind.BATTERY, now_us, numbers))

    def timing(self, now_us: int, work_us: float, lateness_us: float) -> None:
        """Log duration and lateness of a tick; written with the next record."""
        if not self._broken and len(self._waiting) <= MAX_WAITING_BYTES:
            self._waiting += record(Kind.TIMING, now_us, struct.pack("<2d", work_us, lateness_us))

    def frames(self, now_us: int, kind: Kind, frames: Frames) -> None:
        """Log CAN frames that were received (`RECEIVED`) or sent (`SENT`)."""
        if frames.data.shape[1] > 8:
            self._put_frames(now_us, FD_KINDS[kind], FD_FRAME, frames.fd_frames())
            frames = frames.can_frames()
        self._put_frames(now_us, kind, FRAME, frames)

    def _put_frames(self, now_us: int, kind: Kind, layout: struct.Struct, frames: Frames) -> None:
        times = repeat(now_us) if frames.time_us is None else frames.time_us.astype(np.int64).tolist()
        heads = zip(times, frames.channel.tolist(), frames.length.tolist(), frames.id.tolist(), strict=False)
        pairs = zip(heads, frames.data, strict=True)
        content = b"".join(layout.pack(*head, data.tobytes()) for head, data in pairs)
        if content:
            self._put(record(kind, now_us, content))

    def state(self, now_us: int, state: State) -> None:
        """Log a change of the supervisor's state."""
        text = ": ".join([state.mode.value, *state.faults[-1:]])
        self._put(record(Kind.STATE, now_us, text.encode()))

    def note(self, now_us: int, note: str) -> None:
        """Log a request that was refused, clipped or changed."""
        self._put(record(Kind.NOTE, now_us, note.encode()))

    def close(self) -> str:
        """End the file. Returns a line on missing parts; empty if it is complete."""
        if self._missing_parts is None:
            try:
                self._missing_parts = self._close()
            except OSError as error:  # no free file descriptor or thread
                self._missing_parts = f"{self._target} may lack its end: {error.strerror or error}"
            self._locks.close()
        return self._missing_parts

    def _close(self) -> str:
        if self._begun and not self._broken:
            self._may_wait = True
            self._waiting += record(Kind.END, 0)
        try:
            reason, _ = self._process.communicate(bytes(self._waiting), timeout=LAST_WAIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()
            return f"{self._target} has no end: the disk did not accept it within {LAST_WAIT_S:g} s"
        if self._process.returncode:
            why = reason.decode().strip() or "the process that writes it failed"
            return f"{self._target} is truncated: {why}"
        if self._dropped:
            return f"{self._target} lacks {self._dropped} ticks or policy steps: the disk was too slow"
        return ""

    # -- into the pipe -------------------------------------------------------------------------------

    def _put(self, records: bytes) -> None:
        if self._broken:
            return
        if len(self._waiting) > MAX_WAITING_BYTES:
            self._dropped += 1
            self._health = None  # a dropped record may have a change
        else:
            self._waiting += records
        try:
            with suppress(BlockingIOError):
                del self._waiting[: os.write(self._pipe, self._waiting)]
                while self._may_wait and self._waiting:
                    del self._waiting[: os.write(self._pipe, self._waiting)]
        except OSError:  # the process reports the reason
            self._broken = True
            self._waiting.clear()


def _start(file: int | None, feed: int | None) -> "subprocess.Popen[bytes]":
    """Start the writing process in a new session: a terminal's signals do not reach it.

    Args:
        file, feed: descriptors of the log's file and of the feed's listening socket; None for none.
    """
    arguments = [NONE if each is None else str(each) for each in (file, feed)]
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "footfall.deploy.telemetry.process", *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        pass_fds=[each for each in (file, feed) if each is not None],
        start_new_session=True,
    )


def _metadata(robot: Robot, policy: Policy, facts: dict[str, Any]) -> dict[str, str]:
    contract = policy.contract
    content: dict[str, Any] = {
        "policy": policy.name,
        "policy_rate_hz": policy.rate_hz,
        "robot": robot.name,
        "robot_folder": str(robot.folder),
        "robot_digest": robot.digest,
        "joints": list(robot.joint_names),
        "foot_sensors": robot.foot_sensors,
        "contract": None if contract is None else unstructure(contract),
        **facts,
    }
    return {key: json.dumps(value) for key, value in content.items()}
