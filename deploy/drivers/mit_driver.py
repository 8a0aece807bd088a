"""MIT mode: which frames go to which motor, and what came from whom."""

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers import mit
from footfall.deploy.drivers.driver import CanFilter, Motors, Replies, damping_alone
from footfall.deploy.frames import Frames, frame_bits, same_layout
from footfall.deploy.wiring import Wiring

MOTOR_IDS = range(1, 0x80)  # below every reply and IMU identifier
REPLY_ID = 0x100  # a motor replies on REPLY_ID + its id, which loses arbitration against any command
SHARED_REPLY_ID = 0x000  # where motors reply that know only one host

_EVERYONE = slice(None)
_NOBODY = np.zeros(0, dtype=np.intp)


def motor_lookup(wiring: Wiring) -> np.ndarray:
    """Joint index of a motor id on a bus, -1 for none: (buses, 256).

    Raises:
        UserError: a motor id that the protocol cannot carry.
    """
    for joint, motor in zip(wiring.joint_names, wiring.motor_id.tolist(), strict=True):
        if motor not in MOTOR_IDS:
            raise UserError(
                f"joint {joint} has motor id {motor}: MIT mode takes {MOTOR_IDS[0]} to {MOTOR_IDS[-1]}"
            )
    lookup = np.full((len(wiring.buses), 256), -1)
    lookup[wiring.channel, wiring.motor_id] = np.arange(len(wiring.motor_id))
    return lookup


def identifiers(motor: int) -> tuple[int, ...]:
    """All that a motor sends or hears."""
    return motor, REPLY_ID + motor


class MitDriver:
    """The controller's end."""

    identifiers = staticmethod(identifiers)
    filters: tuple[CanFilter, ...] = (
        {"can_id": SHARED_REPLY_ID, "can_mask": 0x7FF, "extended": False},
        {"can_id": REPLY_ID, "can_mask": 0x780, "extended": False},
    )

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor, or a motor id, that MIT mode does not know."""
        n = len(wiring.motor_id)
        self._codec = mit.Codec(wiring.models)
        self.lowest, self.highest = self._codec.lowest, self._codec.highest
        self.gain_rounding = 0.5 * self._codec.quantum[2:4]
        self._lookup = motor_lookup(wiring)
        self._everyone = np.arange(n)
        self._speaks = np.zeros(n, bool)  # unasked: none does
        self._unknown = np.full(n, np.nan)  # no motor tells its voltage
        self.exchange_bits = np.full(n, 2 * frame_bits(8, stuffed=False))
        self._ids = wiring.motor_id.astype(np.uint8).tobytes()
        self._outgoing = Frames(
            wiring.channel, wiring.motor_id, np.zeros((n, 8), np.uint8), np.full(n, 8, dtype=np.intp)
        )
        self._enable = self._outgoing._replace(data=mit.special(mit.ENTER, n))
        self._disable = self._outgoing._replace(data=mit.special(mit.EXIT, n))
        self._zero = self._outgoing._replace(data=mit.special(mit.ZERO, n))
        self._usual = self._outgoing  # the last batch of replies from every motor in joint order
        self._all_whole = True  # whether all of these had eight bytes

    def query_settings(self) -> Frames:
        return self._outgoing.take(_NOBODY)

    def not_ready(self) -> str:
        return ""  # there is nothing to ask for

    def enable(self) -> Frames:
        return self._enable

    def not_enabled(self) -> str:
        return ""  # an answer is all that counts

    def disable(self) -> Frames:
        return self._disable

    def not_confirmed_off(self) -> np.ndarray:
        return self._speaks

    def clear(self) -> Frames:
        return self._outgoing.take(_NOBODY)

    def zero(self) -> Frames:
        return self._zero

    def command(self, values: np.ndarray) -> Frames:
        channel, identifier, _, length, _ = self._outgoing
        return Frames(channel, identifier, self._codec.encode(values), length)

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        return (self.command(damping_alone(kd)),)

    def replies(self, frames: Frames) -> Replies:
        if same_layout(frames, self._usual) and frames.data[:, 0].tobytes() == self._ids:
            return self._decoded(frames, _EVERYONE, self._all_whole)
        sender = frames.data[:, 0].astype(np.intp)
        motor = self._lookup[frames.channel, sender]
        identified = (frames.id == SHARED_REPLY_ID) | (frames.id == sender + REPLY_ID)
        usable = (motor >= 0) & identified & (frames.length >= 6)
        if np.array_equal(motor, self._everyone) and usable.all():
            self._usual, self._all_whole = frames, bool((frames.length == 8).all())
        return self._decoded(frames.take(usable), motor[usable])

    def _decoded(self, frames: Frames, motor: Motors, whole: bool = False) -> Replies:
        """Replies; `whole` are those of eight bytes, which have a temperature."""
        values, temperature, error = self._codec.decode_replies(frames.data, motor)
        told = temperature.astype(float) if whole else np.where(frames.length > 6, temperature, np.nan)
        return Replies(motor, values, error, told, self._unknown[motor], frames.time_us)

    def error_name(self, code: int, joint: int = 0) -> str:
        return mit.ERRORS.get(code, f"error {code}")
