"""What the control loop, and the simulated motors, ask of a motor protocol.

A driver speaks for all motors of one robot at once: arrays are in joint order, and a batch of frames is
built and read in a few array operations. Each protocol has a file of its own that implements both ends.
"""

from enum import IntEnum
from typing import Any, NamedTuple, Protocol

import numpy as np

from footfall.deploy.frames import Frames

Motors = np.ndarray | slice  # which motors: joint indices (k,), or a slice of all of them
CanFilter = dict[str, Any]  # as python-can takes it


class Replies(NamedTuple):
    """What k motors reported."""

    motor: Motors
    values: np.ndarray  # (3, k): position rad, velocity rad/s, torque N m
    temperature_c: np.ndarray  # (k,) degrees Celsius, 0 where it was left out
    error: np.ndarray  # (k,) error code, 0 for none


class Driver(Protocol):
    """The controller's end of a protocol."""

    filters: tuple[CanFilter, ...]  # of the frames that motors send
    lowest: np.ndarray  # (5, n) what a command can say, in the rows of a `JointCommand`
    highest: np.ndarray

    def ask(self) -> Frames:
        """Frames that ask for settings that have to be known, or right, before motors are switched on."""
        ...

    def unready(self) -> str:
        """Which motor may not be switched on yet, and why; empty if all may."""
        ...

    def enable(self) -> Frames:
        """Frames that switch every motor on. Motors answer them."""
        ...

    def disable(self) -> Frames:
        """Frames that switch every motor off."""
        ...

    def command(self, values: np.ndarray) -> Frames:
        """Frames that carry one command to every motor.

        Args:
            values: (5, n), the rows of a `JointCommand`; what lies outside a motor's range is clamped.

        Raises:
            ValueError: a value is not finite.
        """
        ...

    def replies(self, frames: Frames) -> Replies:
        """Decode what motors of this robot sent; other frames are left out."""
        ...

    def error_name(self, code: int, joint: int = 0) -> str:
        """An error code of a joint's motor in words."""
        ...


class Request(IntEnum):
    """What a frame asks of a motor."""

    COMMAND = 0
    ENABLE = 1
    DISABLE = 2
    ZERO = 3  # take the present position for zero


class Requests(NamedTuple):
    """What was asked of k motors, in the order of the frames."""

    motor: Motors
    values: np.ndarray  # (5, k) commands; without meaning where something else was asked
    kind: np.ndarray | None  # (k,) of `Request`; None if all are commands

    def take(self, rows: np.ndarray, joints: int) -> "Requests":
        """Those at some rows (a mask); `joints` is how many the robot has."""
        motor = np.arange(joints)[self.motor]
        return Requests(motor[rows], self.values[:, rows], None if self.kind is None else self.kind[rows])


class MotorEnd(Protocol):
    """The motors' end of a protocol, for simulated ones."""

    filters: tuple[CanFilter, ...]  # of the frames that a controller sends
    time_out_error: int  # the code of a motor that switched itself off because it heard nothing

    def requests(self, frames: Frames) -> Requests:
        """Decode what was sent to motors of this robot; other frames are left out."""
        ...

    def tell(self, frames: Frames) -> Frames | None:
        """What motors answer to questions about their settings; None if nothing was asked."""
        ...

    def reply(
        self,
        motor: Motors,
        values: np.ndarray,
        temperature_c: int,
        error: np.ndarray,
        on: np.ndarray | None = None,
    ) -> Frames:
        """What k motors answer.

        Args:
            motor: which ones.
            values: (3, k) position rad, velocity rad/s, torque N m; clamped to the motors' ranges.
            temperature_c: of all of them.
            error: (k,) uint64 error codes.
            on: (k,) bool, which are switched on; None for all.
        """
        ...
