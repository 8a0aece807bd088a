"""MIT mode: identifiers of commands and replies."""

from typing import NamedTuple

import numpy as np

from footfall.common.bounded_cache import BoundedCache
from footfall.deploy.drivers import mit
from footfall.deploy.drivers.driver import CanFilter, Motors, Replies
from footfall.deploy.drivers.polled import MOTOR_IDS, Orders, PolledDriver, to_every_motor
from footfall.deploy.frames import Frames, Layout, layout_of
from footfall.deploy.wiring import Wiring

REPLY_ID = 0x100  # REPLY_ID + motor id; loses arbitration against any command
SHARED_REPLY_ID = 0x000  # reply identifier of motors that support only one host


_ALL = slice(None)


class _Recognised(NamedTuple):
    """What the first bytes and the layout of a batch determine."""

    rows: np.ndarray | None  # indices of the motors' frames; None: all frames
    motor: Motors
    whole: bool  # all these frames have eight bytes


class MitDriver(PolledDriver):
    """MIT-mode driver."""

    maker = "MIT mode"
    models = tuple(mit.RANGES)
    motor_end = "footfall.plant.motor_ends.mit:MitMotorEnd"
    filters: tuple[CanFilter, ...] = (
        {"can_id": SHARED_REPLY_ID, "can_mask": 0x7FF, "extended": False},
        {"can_id": REPLY_ID, "can_mask": 0x780, "extended": False},
    )

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for an unknown motor model, or a motor id that does not fit into a frame."""
        n = len(wiring.motor_id)
        orders = (mit.special(word, n) for word in (mit.ENTER, mit.EXIT, mit.ZERO))
        super().__init__(wiring, Orders(*(to_every_motor(wiring, data) for data in orders)))
        self._codec = mit.Codec(wiring.models)
        self.lowest, self.highest = self._codec.lowest, self._codec.highest
        self.gain_rounding = 0.5 * self._codec.quantum[2:4]
        self._outgoing = to_every_motor(wiring)
        # A lookup here takes a tenth of the time of `_recognise`.
        self._recognised = BoundedCache[tuple[bytes, Layout], _Recognised]()

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        return motor_id, REPLY_ID + motor_id

    @staticmethod
    def probes(motor_id: int) -> tuple[tuple[int, bytes], ...]:
        return ((motor_id, mit.special(mit.EXIT, 1).tobytes()),)

    @staticmethod
    def senders(frames: Frames) -> np.ndarray:
        first = frames.data[:, 0].astype(np.intp)
        identified = (frames.id == SHARED_REPLY_ID) | (frames.id == REPLY_ID + first)
        identified &= (frames.length >= 6) & np.isin(first, MOTOR_IDS)
        return np.where(identified, first, -1)

    def command(self, values: np.ndarray) -> Frames:
        channel, identifier, _, length, _ = self._outgoing
        return Frames(channel, identifier, self._codec.encode(values), length)

    def replies(self, frames: Frames) -> Replies:
        key = frames.data[:, 0].tobytes(), layout_of(frames)
        known = self._recognised.get(key)
        if known is None:
            known = self._recognised[key] = self._recognise(frames)
        rows, motor, whole = known
        return self._decoded(frames if rows is None else frames.take(rows), motor, whole)

    def _recognise(self, frames: Frames) -> _Recognised:
        sender = self.senders(frames)
        motor = self._lookup[frames.channel, sender]
        rows = np.flatnonzero((motor >= 0) & (sender >= 0))
        motor, whole = motor[rows], bool((frames.length[rows] == 8).all())
        every = np.array_equal(motor, np.arange(len(self._no_voltage)))
        return _Recognised(None if len(rows) == len(sender) else rows, _ALL if every else motor, whole)

    def _decoded(self, frames: Frames, motor: Motors, whole: bool) -> Replies:
        """Decoded replies; those with eight bytes (`whole`) have a temperature."""
        values, temperature, error = self._codec.decode_replies(frames.data, motor)
        reported = temperature.astype(float) if whole else np.where(frames.length > 6, temperature, np.nan)
        return Replies(motor, values, error, reported, self._no_voltage[motor], frames.time_us)

    def error_name(self, code: int, joint: int = 0) -> str:
        return mit.ERRORS.get(code, f"error {code}")
