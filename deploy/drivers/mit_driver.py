"""MIT mode, both ends: which frames go to which motor, and what came from whom."""

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers import mit
from footfall.deploy.drivers.driver import CanFilter, Motors, Replies, Request, Requests
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring

MOTOR_IDS = range(1, 0x80)  # below every reply and IMU identifier
REPLY_ID = 0x100  # a motor replies on REPLY_ID + its id, which loses arbitration against any command
SHARED_REPLY_ID = 0x000  # where motors reply that know only one host

_EVERYONE = slice(None)
_NOBODY = np.zeros(0, dtype=np.intp)
_KIND = {mit.ENTER: Request.ENABLE, mit.EXIT: Request.DISABLE, mit.ZERO: Request.ZERO}


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


def same_layout(frames: Frames, usual: Frames) -> bool:
    """Whether two batches share the very arrays of ids, channels and lengths: cheap, and sufficient."""
    return frames.id is usual.id and frames.channel is usual.channel and frames.length is usual.length


class MitDriver:
    """The controller's end."""

    filters: tuple[CanFilter, ...] = (
        {"can_id": SHARED_REPLY_ID, "can_mask": 0x7FF, "extended": False},
        {"can_id": REPLY_ID, "can_mask": 0x780, "extended": False},
    )

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor, or a motor id, that MIT mode does not know."""
        n = len(wiring.motor_id)
        self._codec = mit.Codec(wiring.models)
        self.lowest, self.highest = self._codec.lowest, self._codec.highest
        self._lookup = motor_lookup(wiring)
        self._everyone = np.arange(n)
        self._ids = wiring.motor_id.astype(np.uint8).tobytes()
        self._outgoing = Frames(
            wiring.channel, wiring.motor_id, np.zeros((n, 8), np.uint8), np.full(n, 8, dtype=np.intp)
        )
        self._enable = self._outgoing._replace(data=mit.special(mit.ENTER, n))
        self._disable = self._outgoing._replace(data=mit.special(mit.EXIT, n))
        self._usual = self._outgoing  # the last batch of replies from every motor in joint order

    def ask(self) -> Frames:
        return self._outgoing.take(_NOBODY)

    def unready(self) -> str:
        return ""  # there is nothing to ask for

    def enable(self) -> Frames:
        return self._enable

    def disable(self) -> Frames:
        return self._disable

    def command(self, values: np.ndarray) -> Frames:
        channel, identifier, _, length = self._outgoing
        return Frames(channel, identifier, self._codec.encode(values), length)

    def replies(self, frames: Frames) -> Replies:
        if same_layout(frames, self._usual) and frames.data[:, 0].tobytes() == self._ids:
            return Replies(_EVERYONE, *self._codec.decode_replies(frames.data, _EVERYONE))
        sender = frames.data[:, 0].astype(np.intp)
        motor = self._lookup[frames.channel, sender]
        identified = (frames.id == SHARED_REPLY_ID) | (frames.id == sender + REPLY_ID)
        usable = (motor >= 0) & identified & (frames.length >= 6)
        if np.array_equal(motor, self._everyone) and usable.all():
            self._usual = frames
        motor = motor[usable]
        return Replies(motor, *self._codec.decode_replies(frames.data[usable], motor))

    def error_name(self, code: int, joint: int = 0) -> str:
        return mit.ERRORS.get(code, f"error {code}")


class MitMotorEnd:
    """The motors' end."""

    filters: tuple[CanFilter, ...] = ({"can_id": 0, "can_mask": 0x7FF - MOTOR_IDS[-1], "extended": False},)
    time_out_error = mit.COMMUNICATION_LOST

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor, or a motor id, that MIT mode does not know."""
        n = len(wiring.motor_id)
        self._codec = mit.Codec(wiring.models)
        self._lookup = motor_lookup(wiring)
        self._everyone = np.arange(n)
        self._head = wiring.motor_id.astype(np.uint64) << np.uint64(56)
        self._outgoing = Frames(
            wiring.channel, REPLY_ID + wiring.motor_id, np.zeros((n, 8), np.uint8), np.full(n, 8, np.intp)
        )
        self._usual = self._outgoing  # the last batch that addressed every motor in joint order

    def requests(self, frames: Frames) -> Requests:
        motor, data = self._addressed(frames)
        word = mit.words(data)
        values = self._codec.decode(word, motor)
        if np.maximum.reduce(word, initial=0) < mit.ENTER:
            return Requests(motor, values, None)
        return Requests(motor, values, np.array([_KIND.get(w, Request.COMMAND) for w in word.tolist()]))

    def _addressed(self, frames: Frames) -> tuple[Motors, np.ndarray]:
        """The motors of this robot that are addressed, and the bytes that they get."""
        if same_layout(frames, self._usual):
            return _EVERYONE, frames.data
        motor = self._lookup[frames.channel, frames.id & 0xFF]
        usable = (motor >= 0) & (frames.id < 0x100) & (frames.length == 8)
        if np.array_equal(motor, self._everyone) and usable.all():
            self._usual = frames
        return motor[usable], frames.data[usable]

    def tell(self, frames: Frames) -> Frames | None:
        return None

    def reply(
        self,
        motor: Motors,
        values: np.ndarray,
        temperature_c: int,
        error: np.ndarray,
        on: np.ndarray | None = None,
    ) -> Frames:
        tail = error | np.uint64(temperature_c << 8)
        data = self._codec.encode_replies(motor, self._head[motor], values, tail)
        channel, identifier, _, length = self._outgoing
        if isinstance(motor, slice):
            return Frames(channel, identifier, data, length)
        return Frames(channel[motor], identifier[motor], data, length[motor])
