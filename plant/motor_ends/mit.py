"""Motors in MIT mode."""

import numpy as np

from footfall.deploy.drivers import mit
from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.drivers.mit_driver import MOTOR_IDS, REPLY_ID, motor_lookup
from footfall.deploy.frames import Frames, same_layout
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import PolledMotorEnd, Request, Requests

KIND = {mit.ENTER: Request.ENABLE, mit.EXIT: Request.DISABLE, mit.ZERO: Request.ZERO}

_EVERYONE = slice(None)


class MitMotorEnd(PolledMotorEnd):
    """The motors' end."""

    filters: tuple[CanFilter, ...] = ({"can_id": 0, "can_mask": 0x7FF - MOTOR_IDS[-1], "extended": False},)
    time_out_error = mit.COMMUNICATION_LOST
    time_out_latches = False
    talkative = False

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor, or a motor id, that MIT mode does not know."""
        n = len(wiring.motor_id)
        self.timeout_s = np.full(n, np.nan)
        self._codec = mit.Codec(wiring.models)
        self._lookup = motor_lookup(wiring)
        self._everyone = np.arange(n)
        self._head = wiring.motor_id.astype(np.uint64) << np.uint64(56)
        self._outgoing = Frames(
            wiring.channel, REPLY_ID + wiring.motor_id, np.zeros((n, 8), np.uint8), np.full(n, 8, np.intp)
        )
        self._usual = self._outgoing  # the last batch that addressed every motor in joint order
        self._asked = b"", Requests(_EVERYONE, np.zeros((5, 0)), None)  # of every motor: bytes, and meaning

    def requests(self, frames: Frames) -> Requests:
        """As `MotorEnd` says. The last answer is kept: a policy's decision is sent again and again."""
        motor, data = self._addressed(frames)
        if not isinstance(motor, slice):
            return self._understood(motor, data)
        key = data.tobytes()
        if key != self._asked[0]:
            self._asked = key, self._understood(motor, data)
        return self._asked[1]

    def _understood(self, motor: Motors, data: np.ndarray) -> Requests:
        word = mit.words(data)
        values = self._codec.decode(word, motor)
        if not len(word) or word[word.argmax()] < mit.ENTER:
            return Requests(motor, values, None)
        return Requests(motor, values, np.array([KIND.get(w, Request.COMMAND) for w in word.tolist()]))

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
        channel, identifier, _, length, _ = self._outgoing
        if isinstance(motor, slice):
            return Frames(channel, identifier, data, length)
        return Frames(channel[motor], identifier[motor], data, length[motor])
