"""Base class of drivers whose motors reply to every frame and send nothing else."""

from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers.driver import damping_alone
from footfall.deploy.frames import Frames, frame_bits, no_frames
from footfall.deploy.wiring import Wiring

MOTOR_IDS = range(1, 0x80)  # below every reply and IMU identifier


class Orders(NamedTuple):
    """Frames with constant content, each a batch for every motor."""

    enable: Frames
    disable: Frames
    zero: Frames
    clear: Frames = no_frames()  # empty for protocols that cannot clear errors


class PolledDriver:
    """Common parts of such drivers. A subclass adds the rest of `MotorDriver`.

    The rest is `maker`, `models`, `motor_end`, `filters`, `identifiers`, `lowest`, `highest`,
    `gain_rounding`, `command`, `replies` and `error_name`, and for motors with settings `query_settings` and
    `not_ready`.
    """

    answers_each_frame = True  # motors reply once to each frame, and send nothing else: shows a second host

    def __init__(self, wiring: Wiring, orders: Orders, extended: bool = False) -> None:
        """Frames have 8 bytes, and identifiers of 29 bits if `extended`.

        Raises:
            UserError: a motor id that does not fit into a frame.
        """
        n = len(wiring.motor_id)
        self._wiring, self._orders = wiring, orders
        self._lookup = motor_lookup(wiring)
        self._no_voltage = np.full(n, np.nan)  # replies have no voltage
        self.exchange_bits = np.full(n, 2 * frame_bits(8, extended))

    @staticmethod
    def probes(motor_id: int) -> tuple[tuple[int, bytes], ...]:
        return ()

    @staticmethod
    def senders(frames: Frames) -> np.ndarray:
        return np.full(len(frames.id), -1)

    def query_settings(self) -> Frames:
        return no_frames()

    def not_ready(self) -> str:
        return ""

    def enable(self) -> Frames:
        return self._orders.enable

    def not_enabled(self) -> str:
        return ""

    def disable(self) -> Frames:
        return self._orders.disable

    def not_confirmed_off(self) -> np.ndarray:
        return np.zeros(len(self._no_voltage), bool)

    def clear(self) -> Frames:
        return self._orders.clear

    def zero(self) -> Frames:
        return self._orders.zero

    def command(self, values: np.ndarray) -> Frames:
        raise NotImplementedError

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        return (self.command(damping_alone(kd)),)


def to_every_motor(wiring: Wiring, data: np.ndarray | None = None) -> Frames:
    """A batch with the motor ids as identifiers and 8 bytes each: `data` (n, 8), or zeros."""
    n = len(wiring.motor_id)
    content = np.zeros((n, 8), np.uint8) if data is None else data
    return Frames(wiring.channel, wiring.motor_id, content, np.full(n, 8))


def motor_lookup(wiring: Wiring) -> np.ndarray:
    """Joint index for a motor id on a bus, -1 for none: (buses, 256).

    Raises:
        UserError: a motor id out of the protocol's range.
    """
    for joint, motor in zip(wiring.joint_names, wiring.motor_id.tolist(), strict=True):
        if motor not in MOTOR_IDS:
            raise UserError(
                f"joint {joint} has motor id {motor}: its protocol takes {MOTOR_IDS[0]} to {MOTOR_IDS[-1]}"
            )
    lookup = np.full((len(wiring.buses), 256), -1)
    lookup[wiring.channel, wiring.motor_id] = np.arange(len(wiring.motor_id))
    return lookup
