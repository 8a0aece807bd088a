"""Motors in MIT mode."""

import numpy as np

from footfall.common.bounded_cache import BoundedCache
from footfall.deploy.drivers import mit
from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.drivers.mit_driver import REPLY_ID
from footfall.deploy.drivers.polled import MOTOR_IDS, motor_lookup
from footfall.deploy.frames import Frames, Layout, layout_of
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import PolledMotorEnd, Report, Request, Requests

KIND = {mit.ENTER: Request.ENABLE, mit.EXIT: Request.DISABLE, mit.ZERO: Request.ZERO}

_ALL = slice(None)


class MitMotorEnd(PolledMotorEnd):
    """Simulated motors in MIT mode."""

    filters: tuple[CanFilter, ...] = ({"can_id": 0, "can_mask": 0x7FF - MOTOR_IDS[-1], "extended": False},)
    timeout_error = mit.COMMUNICATION_LOST

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor model or a motor id that MIT mode does not support."""
        super().__init__(wiring)
        n = len(wiring.motor_id)
        self._codec = mit.Codec(wiring.models)
        self._lookup = motor_lookup(wiring)
        self._head = wiring.motor_id.astype(np.uint64) << np.uint64(56)
        self._outgoing = Frames(
            wiring.channel, REPLY_ID + wiring.motor_id, np.zeros((n, 8), np.uint8), np.full(n, 8, np.intp)
        )
        commands = self._outgoing._replace(id=wiring.motor_id)
        self._full_batch = layout_of(commands)  # layout of a batch that addresses every motor in joint order
        # Motors and rows of other layouts.
        self._other_layouts = BoundedCache[Layout, tuple[np.ndarray, np.ndarray]]()
        # Data of the last full batch, and its requests.
        self._decoded = b"", Requests(_ALL, np.zeros((5, 0)), None)

    def requests(self, frames: Frames) -> Requests:
        """See `MotorEnd.requests`. The last result is kept: a policy's command is sent for several ticks."""
        motor, data = self._addressed(frames)
        if not isinstance(motor, slice):
            return self._decode(motor, data)
        key = data.tobytes()
        if key != self._decoded[0]:
            self._decoded = key, self._decode(motor, data)
        return self._decoded[1]

    def _decode(self, motor: Motors, data: np.ndarray) -> Requests:
        word = mit.words(data)
        values = self._codec.decode(word, motor)
        if not len(word) or word[word.argmax()] < mit.ENTER:
            return Requests(motor, values, None)
        return Requests(motor, values, np.array([KIND.get(w, Request.COMMAND) for w in word.tolist()]))

    def _addressed(self, frames: Frames) -> tuple[Motors, np.ndarray]:
        """The motors of this robot that frames address, and the data for them."""
        layout = layout_of(frames)
        if layout == self._full_batch:
            return _ALL, frames.data
        cached = self._other_layouts.get(layout)
        if cached is None:
            motor = self._lookup[frames.channel, frames.id & 0xFF]
            rows = np.flatnonzero((motor >= 0) & (frames.id < 0x100) & (frames.length == 8))
            cached = self._other_layouts[layout] = motor[rows], rows
        motor, rows = cached
        return motor, frames.data[rows]

    def reply(self, motor: Motors, report: Report) -> Frames:
        tail = report.error | np.array(report.temperature_c << 8, np.uint64)
        data = self._codec.encode_replies(motor, self._head[motor], report.values, tail)
        channel, identifier, _, length, _ = self._outgoing
        if isinstance(motor, slice):
            return Frames(channel, identifier, data, length)
        return Frames(channel[motor], identifier[motor], data, length[motor])
