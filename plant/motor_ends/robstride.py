"""RobStride motors in operation (MIT) mode."""

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.drivers.mit_driver import motor_lookup
from footfall.deploy.drivers.robstride import (
    CONTROL,
    ENABLE,
    FAULT,
    FEEDBACK,
    HOST,
    READ,
    REPLIED,
    REPORTED,
    RUN_MODE,
    RUNNING,
    STOP,
    TIME_OUT,
    TIME_OUT_STEP_S,
    WRITE,
    ZERO,
    Codec,
    identifier_of,
    payload,
    words_of,
)
from footfall.deploy.frames import EXTENDED, Frames, joined
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import PolledMotorEnd, Request, Requests, time_outs

DELIVERED_TIME_OUT = 2000  # 0.1 s
_KIND = {CONTROL: Request.COMMAND, ENABLE: Request.ENABLE, STOP: Request.DISABLE, ZERO: Request.ZERO}


class RobstrideMotorEnd(PolledMotorEnd):
    """The motors' end. `parameters` are what each tells of itself."""

    filters: tuple[CanFilter, ...] = ({"can_id": 0, "can_mask": 0, "extended": True},)
    time_out_error = 0  # it switches itself off, and says no more than that
    time_out_latches = False
    talkative = False

    def __init__(self, wiring: Wiring) -> None:
        self._wiring, self._lookup = wiring, motor_lookup(wiring)
        self._codec = Codec(wiring.models)
        self.parameters = [{RUN_MODE: 0, TIME_OUT: DELIVERED_TIME_OUT} for _ in wiring.models]
        self._length = np.full(len(wiring.models), 8)

    @property
    def timeout_s(self) -> np.ndarray:
        return time_outs([own[TIME_OUT] for own in self.parameters], TIME_OUT_STEP_S)

    def requests(self, frames: Frames) -> Requests:
        kind, addressee = frames.id >> 24 & 0x1F, frames.id & 0xFF
        motor = self._lookup[frames.channel, addressee]
        usable = (frames.id >= EXTENDED) & (motor >= 0) & (frames.length == 8) & np.isin(kind, [*_KIND])
        motor, kind, frames = motor[usable], kind[usable], frames.take(usable)
        codes = np.vstack([words_of(frames.data), frames.id >> 8 & 0xFFFF])
        values = self._codec.values(codes, [0, 1, 2, 3, 4], motor)
        if (kind == CONTROL).all():
            return Requests(motor, values, None)
        kinds = np.array([_KIND[each] for each in kind.tolist()])
        kinds[(kind == STOP) & (frames.data[:, 0] == 1)] = Request.CLEAR
        return Requests(motor, values, kinds)

    def tell(self, frames: Frames) -> Frames | None:
        """As `MotorEnd.tell`. A write is taken in without the reply that a real motor sends."""
        motor, kind = self._lookup[frames.channel, frames.id & 0xFF], frames.id >> 24 & 0x1F
        asked = (frames.id >= EXTENDED) & np.isin(kind, (READ, WRITE)) & (motor >= 0) & (frames.length == 8)
        rows = np.flatnonzero(asked)
        data, who = frames.data[rows].copy(), motor[rows]
        for row, joint, write in zip(data, who.tolist(), (kind[rows] == WRITE).tolist(), strict=True):
            parameter, own = int(row[0]) | int(row[1]) << 8, self.parameters[joint]
            if write and parameter in own:
                own[parameter] = int.from_bytes(row[4:].tobytes(), "little")
            row[4:] = list(own.get(parameter, 0).to_bytes(4, "little"))
        told = kind[rows] == READ
        if not told.any():
            return None
        data, who = data[told], who[told]
        identifier = identifier_of(READ, self._wiring.motor_id[who], HOST)
        return Frames(self._wiring.channel[who], identifier, data, self._length[who])

    def reply(
        self,
        motor: Motors,
        values: np.ndarray,
        temperature_c: int,
        error: np.ndarray,
        on: np.ndarray | None = None,
    ) -> Frames:
        """A fault that is reported (type 21) precedes the reply."""
        running = np.ones(len(error), bool) if on is None else on
        codes = self._codec.codes(values, REPLIED, motor)
        words = np.vstack([codes, np.full(len(error), 10 * temperature_c)])
        code = error.astype(np.intp)
        reported = code >= REPORTED
        about = self._wiring.motor_id[motor] | np.where(reported, 0, code) << 8 | running * RUNNING << 14
        identifier = identifier_of(FEEDBACK, about, HOST)
        frames = Frames(self._wiring.channel[motor], identifier, payload(words), self._length[motor])
        if not reported.any():
            return frames
        report = frames.take(reported)
        word = (np.uint32(1) << (code[reported] - REPORTED).astype(np.uint32)).astype("<u4")
        data = np.zeros((len(word), 8), np.uint8)
        data[:, :4] = word.view(np.uint8).reshape(-1, 4)
        about = self._wiring.motor_id[motor][reported]
        return joined([report._replace(id=identifier_of(FAULT, about, HOST), data=data), frames])
