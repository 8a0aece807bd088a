"""The motors' end of a motor protocol: the interface that simulated motors use.

A user's own driver (`deploy/drivers/driver.py`) names the class of its simulated motors in `motor_end`. The
class implements `MotorEnd`; `PolledMotorEnd` is a base class for motors that only answer requests.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple, Protocol

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring

DEFAULT_SUPPLY = (24.0, 1.0)  # V, and A of each motor, without a declared battery


class Request(IntEnum):
    """The request of a frame to a motor."""

    COMMAND = 0
    ENABLE = 1
    DISABLE = 2
    ZERO = 3  # set the current position as zero
    CLEAR = 4  # clear latched errors
    STOP = 5  # disable, and clear latched errors
    RUN = 6  # enable, unless an error is latched, and follow the command
    READ = 7  # answer, and nothing else


class Requests(NamedTuple):
    """Requests to k motors, in the order of the frames."""

    motor: Motors
    values: np.ndarray  # (5, k) commands, read only; undefined for other kinds of request
    kind: np.ndarray | None  # (k,) of `Request`; None if all are commands

    def take(self, rows: np.ndarray, joints: int) -> "Requests":
        """The requests at some rows (a mask), for a robot with this number of joints."""
        motor = np.arange(joints)[self.motor]
        return Requests(motor[rows], self.values[:, rows], None if self.kind is None else self.kind[rows])


class Report(NamedTuple):
    """The state of k motors."""

    values: np.ndarray  # (3, k) position rad, velocity rad/s, torque N m, at the joint
    error: np.ndarray  # (k,) uint64 error codes, 0 for none
    on: np.ndarray  # (k,) bool, which are enabled
    temperature_c: int | np.ndarray = 30  # of all, or (k,)
    supply: tuple[float, float] = DEFAULT_SUPPLY  # V, and A of each motor

    def take(self, motor: Motors) -> "Report":
        """The state of some of these motors (indices), or of all (a slice)."""
        if isinstance(motor, slice):
            return self
        temperature_c = self.temperature_c
        if isinstance(temperature_c, np.ndarray):
            temperature_c = temperature_c[motor]
        return Report(self.values[:, motor], self.error[motor], self.on[motor], temperature_c, self.supply)


class MotorEnd(Protocol):
    """The motors' end of a protocol, for n simulated motors."""

    filters: tuple[CanFilter, ...]  # of the frames that a controller sends
    broadcasts: bool  # whether motors send frames without a request

    @property
    def timeout_error(self) -> int | np.ndarray:
        """Error code of a motor that timed out: of all, or (n,)."""
        ...

    @property
    def timeout_latches(self) -> bool | np.ndarray:
        """Whether a motor that timed out stays off until its errors are cleared: of all, or (n,)."""
        ...

    @property
    def timeout_s(self) -> np.ndarray:
        """Time without a request after which a motor disables itself, s, (n,); NaN if no frame sets it."""
        ...

    def requests(self, frames: Frames) -> Requests:
        """Decode frames to motors of this robot; other frames are ignored."""
        ...

    def settings_replies(self, frames: Frames) -> Frames | None:
        """Read and write settings as frames request; returns the answers, None for no answer."""
        ...

    def reply(self, motor: Motors, report: Report) -> Frames:
        """The answers of k motors (indices, or a slice of all), with the state in `report`.

        Values are clamped to the motors' ranges.
        """
        ...

    def broadcast(self, now_us: int, connected: np.ndarray, report: Report) -> Frames | None:
        """Frames that motors send without a request in the millisecond that begins now; None: no frames.

        Args:
            now_us: simulated time.
            connected: (n,) bool, which motors are connected.
            report: the state of all motors.
        """
        ...


class PolledMotorEnd:
    """Base of motors' ends that answer requests and broadcast nothing.

    A subclass adds `filters`, `requests` and `reply`, and `settings_replies` for motors with settings.
    """

    broadcasts = False
    timeout_error: int = 0
    timeout_latches = False

    def __init__(self, wiring: Wiring) -> None:
        """`wiring` has only the motors of this protocol."""
        self._wiring = wiring

    @property
    def timeout_s(self) -> np.ndarray:
        return np.full(len(self._wiring.motor_id), np.nan)

    def settings_replies(self, frames: Frames) -> Frames | None:
        return None

    def broadcast(self, now_us: int, connected: np.ndarray, report: Report) -> Frames | None:
        return None


def timeouts(counts: Sequence[float], step_s: float) -> np.ndarray:
    """Timeouts in s, (n,), from counts of `step_s`; a count of 0 means no timeout."""
    return np.where(np.array(counts) == 0, np.inf, np.array(counts) * step_s)
