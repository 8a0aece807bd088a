"""What the control loop, and the simulated motors, ask of a motor protocol.

A driver speaks for all motors of one robot at once: arrays are in joint order, and a batch of frames is
built and read in a few array operations. Each protocol has a file of its own here; the motors' ends are
in `plant/motor_ends/`.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from footfall.deploy.frames import Frames

Motors = np.ndarray | slice  # which motors: joint indices (k,), or a slice of all of them
CanFilter = dict[str, Any]  # as python-can takes it


class Replies(NamedTuple):
    """What k motors reported."""

    motor: Motors
    values: np.ndarray  # (3, k): position rad, velocity rad/s, torque N m
    error: np.ndarray  # (k,) error code, 0 for none
    temperature_c: np.ndarray  # (k,) degrees Celsius, NaN where the motor does not say
    voltage: np.ndarray  # (k,) V at the motor's supply, NaN where it does not say
    time_us: np.ndarray | None  # (k,) when each frame arrived; None where nobody knows


def damping_alone(kd: np.ndarray) -> np.ndarray:
    """A command (5, n) that damps, kd (n,) in N m s/rad, and does nothing else."""
    values = np.zeros((5, len(kd)))
    values[3] = kd
    return values


class Driver(Protocol):
    """The controller's end of a protocol."""

    filters: tuple[CanFilter, ...]  # of the frames that motors send
    lowest: np.ndarray  # (5, n) what a command can say, in the rows of a `JointCommand`
    highest: np.ndarray
    gain_rounding: np.ndarray  # (2, n) most that a frame's rounding adds to stiffness and to damping
    exchange_bits: np.ndarray  # (n,) least that a command and its answer take on the wire, without stuff bits

    def query_settings(self) -> Frames:
        """Frames that read, or write, the settings that must be right before motors are enabled."""
        ...

    def not_ready(self) -> str:
        """First motor whose settings do not permit enabling it, and why; empty if all permit it."""
        ...

    def enable(self) -> Frames:
        """Frames that enable every motor: sent at each tick until all answer and `not_enabled` is empty."""
        ...

    def not_enabled(self) -> str:
        """First motor that has not confirmed enable; empty if all have.

        Always empty for protocols whose motors confirm nothing but answer every frame.
        """
        ...

    def disable(self) -> Frames:
        """Frames that disable every motor."""
        ...

    def not_confirmed_off(self) -> np.ndarray:
        """Mask (n,) of the motors that broadcast their state and have not confirmed disable.

        False for motors that answer every frame: their answer to `disable` is the confirmation.
        """
        ...

    def clear(self) -> Frames:
        """Frames that clear the errors that motors have latched; none for makers that know no such frame."""
        ...

    def zero(self) -> Frames:
        """Frames that make every motor take its present position for zero."""
        ...

    def command(self, values: np.ndarray) -> Frames:
        """Frames that carry one command to every motor.

        Args:
            values: (5, n), the rows of a `JointCommand`; what lies outside a motor's range is clamped.

        Raises:
            ValueError: a value is not finite.
        """
        ...

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        """Frames that have motors damp joints whatever was read: batches to be sent in turn, over and over.

        Args:
            kd: of each joint, N m s/rad, (n,).
        """
        ...

    def replies(self, frames: Frames) -> Replies:
        """Decode what motors of this robot sent; other frames are left out."""
        ...

    def error_name(self, code: int, joint: int = 0) -> str:
        """An error code of a joint's motor in words."""
        ...
