"""What the control loop and the bench require of a motor protocol.

A driver encodes and decodes the frames of all motors of one robot at once: arrays are in joint order, and a
batch of frames takes a few array operations. Each protocol has a file of its own here. Its simulated motors
are in `plant/motor_ends/`.

A driver of one's own is a class that `protocol` of a motor in robot.yaml names as MODULE:NAME. It implements
`MotorDriver`; `PolledDriver` (`drivers/polled.py`) has most of that for motors that answer every frame.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring

Motors = np.ndarray | slice  # joint indices (k,), or a slice of all joints
CanFilter = dict[str, Any]  # as python-can takes it: can_id, can_mask, extended; `fd` for CAN FD frames


class Replies(NamedTuple):
    """Readings of k motors."""

    motor: Motors
    values: np.ndarray  # (3, k): position rad, velocity rad/s, torque N m, at the joint
    error: np.ndarray  # (k,) error code, 0 for none
    temperature_c: np.ndarray  # (k,) degrees Celsius, NaN where a motor does not report it
    voltage: np.ndarray  # (k,) V at the motor's supply, NaN where a motor does not report it
    time_us: np.ndarray | None  # (k,) arrival time of each frame; None where unknown
    current_a: np.ndarray | None = None  # (k,) drawn from the supply, A; None where none reports it


def damping_alone(kd: np.ndarray) -> np.ndarray:
    """A command (5, n) of damping kd (n,), N m s/rad, without stiffness or torque."""
    values = np.zeros((5, len(kd)))
    values[3] = kd
    return values


class Driver(Protocol):
    """The controller's end of a protocol, for n motors."""

    filters: tuple[CanFilter, ...]  # which frames motors send
    exchange_bits: np.ndarray  # (n,) most bits of a command and its answer on the wire, stuff bits included

    @property
    def lowest(self) -> np.ndarray:
        """Least command that a frame can carry, (5, n): the rows of a `JointCommand`."""
        ...

    @property
    def highest(self) -> np.ndarray:
        """Greatest command that a frame can carry, (5, n)."""
        ...

    @property
    def gain_rounding(self) -> np.ndarray:
        """The most that a frame's rounding adds to stiffness and to damping, (2, n)."""
        ...

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

        Always empty where a motor's answer to `enable` is the confirmation.
        """
        ...

    def disable(self) -> Frames:
        """Frames that disable every motor."""
        ...

    def not_confirmed_off(self) -> np.ndarray:
        """Mask (n,) of the motors that report their state and have not confirmed disable.

        False where a motor's answer to `disable` is the only confirmation.
        """
        ...

    def clear(self) -> Frames:
        """Frames that clear latched errors; an empty batch for protocols without such a frame."""
        ...

    def zero(self) -> Frames:
        """Frames that make every motor take its present position for zero."""
        ...

    def command(self, values: np.ndarray) -> Frames:
        """Frames that carry one command to every motor.

        Args:
            values: (5, n), the rows of a `JointCommand`: position rad, velocity rad/s, stiffness N m/rad,
                damping N m s/rad, torque N m, at the joint. Values outside a motor's range are clamped.

        Raises:
            ValueError: a value is not finite.
        """
        ...

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        """Frames that make motors damp joints without a reading: batches to be sent in turn, repeatedly.

        Args:
            kd: damping of each joint, N m s/rad, (n,).
        """
        ...

    def replies(self, frames: Frames) -> Replies:
        """Decode the frames of this robot's motors; other frames are left out."""
        ...

    def error_name(self, code: int, joint: int = 0) -> str:
        """An error code of a joint's motor in words that complete "the motor reports ..."."""
        ...


class MotorDriver(Driver, Protocol):
    """A driver class of one protocol, as `drivers/choice.py` lists it or robot.yaml names it.

    A class may have `drive_limits: tuple[str, ...]`: "torque" or "current", which it sets in the drive to
    `wiring.highest` and reads back where robot.yaml asks for it as `drive_limit`.
    """

    maker: str  # name in tables
    models: tuple[str, ...]  # motor models that robot.yaml may name; empty for a class that it names itself
    motor_end: str  # MODULE:NAME of the simulated motors (`plant/motor_ends/motor_end.py`); empty for none

    def __init__(self, wiring: Wiring) -> None:
        """`wiring` has the motors of this protocol alone.

        Raises:
            UserError: a motor id that a frame cannot carry.
        """
        ...

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        """All 11-bit identifiers that a motor of this id sends or receives."""
        ...

    @staticmethod
    def probes(motor_id: int) -> tuple[tuple[int, bytes], ...]:
        """Frames (identifier, content) that a motor of this id answers, for `footfall can scan`.

        The content has 8 bytes, or as many as a frame of CAN FD can have. They disable a motor or read from
        it. None for motors that broadcast their state.
        """
        ...

    @staticmethod
    def senders(frames: Frames) -> np.ndarray:
        """The motor id of each frame that only motors of this protocol send, -1 for others, (k,)."""
        ...
