"""RobStride motors in operation (MIT) mode."""

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.drivers.polled import motor_lookup
from footfall.deploy.drivers.robstride import (
    CONTROL,
    ENABLE,
    FAULT,
    FEEDBACK,
    HOST,
    RANGES,
    READ,
    REPLY_ROWS,
    REPORTED,
    RUN_MODE,
    RUNNING,
    STOP,
    TIMEOUT,
    TIMEOUT_STEP_S,
    TORQUE_LIMIT,
    WRITE,
    ZERO,
    Codec,
    identifier_of,
    parameter_bytes,
    parameter_value,
    payload,
    words_of,
)
from footfall.deploy.frames import EXTENDED, Frames, joined
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import PolledMotorEnd, Report, Request, Requests, timeouts

FACTORY_TIMEOUT = 2000  # 0.1 s
_KIND = {CONTROL: Request.COMMAND, ENABLE: Request.ENABLE, STOP: Request.DISABLE, ZERO: Request.ZERO}


class RobstrideMotorEnd(PolledMotorEnd):
    """Simulated RobStride motors. `parameters` has the parameters of each motor, by index."""

    filters: tuple[CanFilter, ...] = ({"can_id": 0, "can_mask": 0, "extended": True},)
    timeout_error = 0  # the motor disables itself and reports no error

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        self._lookup = motor_lookup(wiring)
        self._codec = Codec(wiring.models)
        self.parameters: list[dict[int, float]] = [
            {RUN_MODE: 0, TORQUE_LIMIT: RANGES[model].torque, TIMEOUT: FACTORY_TIMEOUT}
            for model in wiring.models
        ]
        self._length = np.full(len(wiring.models), 8)

    @property
    def timeout_s(self) -> np.ndarray:
        return timeouts([parameters[TIMEOUT] for parameters in self.parameters], TIMEOUT_STEP_S)

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

    def settings_replies(self, frames: Frames) -> Frames | None:
        """See `MotorEnd.settings_replies`. A write gets no reply, unlike with a real motor."""
        motor, kind = self._lookup[frames.channel, frames.id & 0xFF], frames.id >> 24 & 0x1F
        addressed = (
            (frames.id >= EXTENDED) & np.isin(kind, (READ, WRITE)) & (motor >= 0) & (frames.length == 8)
        )
        rows = np.flatnonzero(addressed)
        data, joints = frames.data[rows].copy(), motor[rows]
        for row, joint, write in zip(data, joints.tolist(), (kind[rows] == WRITE).tolist(), strict=True):
            parameter, parameters = int(row[0]) | int(row[1]) << 8, self.parameters[joint]
            if write and parameter in parameters:
                parameters[parameter] = parameter_value(parameter, row[4:].tobytes())
            row[4:] = list(parameter_bytes(parameter, parameters.get(parameter, 0)))
        read = kind[rows] == READ
        if not read.any():
            return None
        data, joints = data[read], joints[read]
        identifier = identifier_of(READ, self._wiring.motor_id[joints], HOST)
        return Frames(self._wiring.channel[joints], identifier, data, self._length[joints])

    def reply(self, motor: Motors, report: Report) -> Frames:
        """A fault that is reported (type 21) precedes the reply."""
        codes = self._codec.codes(report.values, REPLY_ROWS, motor)
        words = np.vstack([codes, np.full(len(report.error), 10 * report.temperature_c)])
        code = report.error.astype(np.intp)
        reported = code >= REPORTED
        id_data = self._wiring.motor_id[motor] | np.where(reported, 0, code) << 8 | report.on * RUNNING << 14
        identifier = identifier_of(FEEDBACK, id_data, HOST)
        frames = Frames(self._wiring.channel[motor], identifier, payload(words), self._length[motor])
        if not reported.any():
            return frames
        faults = frames.take(reported)
        word = (np.uint32(1) << (code[reported] - REPORTED).astype(np.uint32)).astype("<u4")
        data = np.zeros((len(word), 8), np.uint8)
        data[:, :4] = word.view(np.uint8).reshape(-1, 4)
        id_data = self._wiring.motor_id[motor][reported]
        return joined([faults._replace(id=identifier_of(FAULT, id_data, HOST), data=data), frames])
