"""Interface of motor protocols for the control loop and the bench.

A driver encodes and decodes the frames of all motors of one robot at once: arrays are in joint order, and a
batch of frames takes a few array operations. Each protocol has its own file here. Its simulated motors
are in `plant/motor_ends/`.

An external driver is a class that a motor's `protocol` in robot.yaml names as MODULE:NAME. It implements
`MotorDriver`; `PolledDriver` (`drivers/polled.py`) has most of that for motors that reply to every frame.
"""

from typing import Any, NamedTuple, Protocol

import numpy as np

from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring

Motors = np.ndarray | slice  # joint indices (k,), or a slice of all joints
CanFilter = dict[str, Any]  # format of python-can: can_id, can_mask, extended; `fd` for CAN FD frames


class Replies(NamedTuple):
    """Readings of k motors."""

    motor: Motors
    values: np.ndarray  # (3, k): position rad, velocity rad/s, torque N m, at the joint
    error: np.ndarray  # (k,) error code, 0 for none
    temperature_c: np.ndarray  # (k,) degrees Celsius, NaN if not reported
    voltage: np.ndarray  # (k,) V at the motor's supply, NaN if not reported
    time_us: np.ndarray | None  # (k,) arrival time of each frame; None if unknown
    current_a: np.ndarray | None = None  # (k,) supply current, A; None if no motor reports it


def damping_alone(kd: np.ndarray) -> np.ndarray:
    """Command (5, n) with only damping kd (n,), N m s/rad."""
    values = np.zeros((5, len(kd)))
    values[3] = kd
    return values


class Driver(Protocol):
    """Controller's side of a protocol, for n motors."""

    filters: tuple[CanFilter, ...]  # filters for the frames of motors
    exchange_bits: np.ndarray  # (n,) largest number of bits of a command and its reply, including stuff bits

    @property
    def lowest(self) -> np.ndarray:
        """Lower limit of a command in a frame, (5, n): the rows of a `JointCommand`."""
        ...

    @property
    def highest(self) -> np.ndarray:
        """Upper limit of a command in a frame, (5, n)."""
        ...

    @property
    def gain_rounding(self) -> np.ndarray:
        """Largest increase of stiffness and damping by the rounding in a frame, (2, n)."""
        ...

    def query_settings(self) -> Frames:
        """Frames that read or write the settings that must be right before motors are enabled."""
        ...

    def not_ready(self) -> str:
        """First motor whose settings do not permit enabling it, with the reason; empty if all permit it."""
        ...

    def enable(self) -> Frames:
        """Frames that enable every motor: sent at each tick until all reply and `not_enabled` is empty."""
        ...

    def not_enabled(self) -> str:
        """First motor that has not confirmed enable; empty if all have.

        Always empty if a motor's reply to `enable` is the confirmation.
        """
        ...

    def disable(self) -> Frames:
        """Frames that disable every motor."""
        ...

    def not_confirmed_off(self) -> np.ndarray:
        """Mask (n,) of motors that report their state and have not confirmed disable.
        False if a motor's reply to `disable` is the only confirmation.
        """
        ...

    def clear(self) -> Frames:
        """Frames that clear latched errors; an empty batch for protocols without such a frame."""
        ...

    def zero(self) -> Frames:
        """Frames that set the zero of every motor to its current position."""
        ...

    def command(self, values: np.ndarray) -> Frames:
        """Frames with one command for every motor.

        Args:
            values: (5, n), the rows of a `JointCommand`: position rad, velocity rad/s, stiffness N m/rad,
                damping N m s/rad, torque N m, at the joint. Values outside a motor's range are clamped.

        Raises:
            ValueError: a value is not finite.
        """
        ...

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        """Frames that make motors damp joints without readings: batches to be sent in turn, repeatedly.

        Args:
            kd: damping of each joint, N m s/rad, (n,).
        """
        ...

    def replies(self, frames: Frames) -> Replies:
        """Decode the frames of this robot's motors; other frames are ignored."""
        ...

    def error_name(self, code: int, joint: int = 0) -> str:
        """Text for an error code of a joint's motor that completes "the motor reports ..."."""
        ...


class MotorDriver(Driver, Protocol):
    """Driver class of one protocol, listed in `drivers/choice.py` or named in robot.yaml.

    A class may have `drive_limits: tuple[str, ...]`: "torque" or "current", which it sets in the drive to
    `wiring.highest` and reads back if robot.yaml has it as `drive_limit`.
    """

    maker: str  # name for tables
    models: tuple[str, ...]  # motor models for robot.yaml; empty for an external class
    motor_end: str  # MODULE:NAME of the simulated motors (`plant/motor_ends/motor_end.py`); empty for none

    def __init__(self, wiring: Wiring) -> None:
        """`wiring` has only the motors of this protocol.

        Raises:
            UserError: a motor id that does not fit into a frame.
        """
        ...

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        """All 11-bit identifiers that a motor with this id sends or receives."""
        ...

    @staticmethod
    def probes(motor_id: int) -> tuple[tuple[int, bytes], ...]:
        """Frames (identifier, content) to which a motor with this id replies, for `footfall can scan`.

        The content has 8 bytes, or up to the length of a CAN FD frame. The frames disable a motor or read
        from it. Empty for motors that broadcast their state.
        """
        ...

    @staticmethod
    def senders(frames: Frames) -> np.ndarray:
        """Motor id of each frame that only motors of this protocol send, -1 for others, (k,)."""
        ...
