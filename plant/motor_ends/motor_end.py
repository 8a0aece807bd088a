"""What the simulated motors ask of a motor protocol."""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple, Protocol

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.frames import Frames


class Request(IntEnum):
    """What a frame asks of a motor."""

    COMMAND = 0
    ENABLE = 1
    DISABLE = 2
    ZERO = 3  # take the present position for zero
    CLEAR = 4  # forget errors


class Requests(NamedTuple):
    """What was asked of k motors, in the order of the frames."""

    motor: Motors
    values: (
        np.ndarray
    )  # (5, k) commands, not to be written to; without meaning where something else was asked
    kind: np.ndarray | None  # (k,) of `Request`; None if all are commands

    def take(self, rows: np.ndarray, joints: int) -> "Requests":
        """Those at some rows (a mask); `joints` is how many the robot has."""
        motor = np.arange(joints)[self.motor]
        return Requests(motor[rows], self.values[:, rows], None if self.kind is None else self.kind[rows])


class MotorEnd(Protocol):
    """The motors' end of a protocol, for simulated ones."""

    filters: tuple[CanFilter, ...]  # of the frames that a controller sends
    talkative: bool  # whether motors send by themselves, unasked

    @property
    def time_out_error(self) -> int | np.ndarray:
        """The code of a motor that heard nothing and switched itself off: of all, or (n,)."""
        ...

    @property
    def time_out_latches(self) -> bool | np.ndarray:
        """Whether such a motor stays off until its errors are cleared: of all, or (n,)."""
        ...

    @property
    def timeout_s(self) -> np.ndarray:
        """(n,) after which a motor that hears nothing switches itself off; NaN where no frame sets that."""
        ...

    def requests(self, frames: Frames) -> Requests:
        """Decode what was sent to motors of this robot; other frames are left out."""
        ...

    def tell(self, frames: Frames) -> Frames | None:
        """What motors answer to questions about their settings, and take in of them; None for no answer."""
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

    def broadcast(
        self,
        now_us: int,
        speaking: np.ndarray,
        values: np.ndarray,
        temperature_c: int,
        error: np.ndarray,
        on: np.ndarray,
    ) -> Frames | None:
        """What motors send by themselves in the millisecond that begins now; None for nothing.

        Args:
            now_us: simulated time.
            speaking: (n,) bool, which are heard.
            values, temperature_c, error, on: as for `reply`, of all motors.
        """
        ...


class PolledMotorEnd:
    """Of makers whose motors answer when they are polled, and send nothing by themselves."""

    def broadcast(
        self,
        now_us: int,
        speaking: np.ndarray,
        values: np.ndarray,
        temperature_c: int,
        error: np.ndarray,
        on: np.ndarray,
    ) -> Frames | None:
        return None


def time_outs(counts: Sequence[float], step_s: float) -> np.ndarray:
    """Time-outs in s, (n,), that are counted in steps of `step_s`; a count of 0 is none."""
    return np.where(np.array(counts) == 0, np.inf, np.array(counts) * step_s)
