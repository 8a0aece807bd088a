"""Damiao motors in MIT mode."""

import struct

import numpy as np

from footfall.deploy.drivers import mit
from footfall.deploy.drivers.damiao import (
    COMMUNICATION_LOST,
    INTEGERS,
    MIT_MODE,
    MODE,
    POSITION_MAX,
    RANGES,
    READ,
    REGISTER_ID,
    REPLY_ID,
    TIMEOUT,
    TIMEOUT_STEP_S,
    TORQUE_MAX,
    VELOCITY_MAX,
    WRITE,
)
from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.drivers.mit import MotorRange
from footfall.deploy.drivers.polled import MOTOR_IDS, motor_lookup
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends import mit as mit_end
from footfall.plant.motor_ends.motor_end import PolledMotorEnd, Report, Request, Requests, timeouts

FACTORY_TIMEOUT = 2000  # 0.1 s
KIND = {**mit_end.KIND, mit.CLEAR: Request.CLEAR}


class DamiaoMotorEnd(PolledMotorEnd):
    """Simulated Damiao motors. `registers` has the registers of each motor, by number."""

    filters: tuple[CanFilter, ...] = (
        {"can_id": 0, "can_mask": 0x7FF - MOTOR_IDS[-1], "extended": False},
        {"can_id": REGISTER_ID, "can_mask": 0x7FF, "extended": False},
    )
    timeout_error = COMMUNICATION_LOST

    def __init__(self, wiring: Wiring, ranges: list[MotorRange] | None = None) -> None:
        """`ranges` are the motors' own; default: those of the maker's table."""
        super().__init__(wiring)
        self._lookup = motor_lookup(wiring)
        ranges = ranges or [RANGES[model] for model in wiring.models]
        self._codec = mit.Codec.of(ranges)
        self.registers: list[dict[int, float]] = [
            {
                TIMEOUT: FACTORY_TIMEOUT,
                MODE: MIT_MODE,
                POSITION_MAX: r.position,
                VELOCITY_MAX: r.velocity,
                TORQUE_MAX: r.torque,
            }
            for r in ranges
        ]
        self._reply_id = REPLY_ID + wiring.motor_id
        self._length = np.full(len(wiring.motor_id), 8)

    @property
    def timeout_s(self) -> np.ndarray:
        return timeouts([registers[TIMEOUT] for registers in self.registers], TIMEOUT_STEP_S)

    def requests(self, frames: Frames) -> Requests:
        motor = self._lookup[frames.channel, frames.id & 0xFF]
        usable = (motor >= 0) & (frames.id <= MOTOR_IDS[-1]) & (frames.length == 8)
        word = mit.words(frames.data[usable])
        kind = None
        if np.maximum.reduce(word, initial=0) >= mit.CLEAR:
            kind = np.array([KIND.get(w, Request.COMMAND) for w in word.tolist()])
        return Requests(motor[usable], self._codec.decode(word, motor[usable]), kind)

    def settings_replies(self, frames: Frames) -> Frames | None:
        access = np.isin(frames.data[:, 2], (READ, WRITE))
        addressed = (frames.id == REGISTER_ID) & (frames.length == 8) & access
        motor = self._lookup[frames.channel, frames.data[:, 0]]
        rows = np.flatnonzero(addressed & (motor >= 0) & (frames.data[:, 1] == 0))
        if not len(rows):
            return None
        data, joints = frames.data[rows].copy(), motor[rows]
        for row, joint in zip(data, joints.tolist(), strict=True):
            register, registers = int(row[3]), self.registers[joint]
            code = "<I" if register in INTEGERS else "<f"
            if row[2] == WRITE and register in registers:
                (registers[register],) = struct.unpack(code, row[4:].tobytes())
            value = registers.get(register, 0)
            row[4:] = np.frombuffer(
                struct.pack(code, int(value) if register in INTEGERS else value), np.uint8
            )
        return Frames(self._wiring.channel[joints], self._reply_id[joints], data, self._length[joints])

    def reply(self, motor: Motors, report: Report) -> Frames:
        error, temperature_c = report.error, report.temperature_c
        state = np.where(error != 0, error, report.on.astype(np.uint64))
        first = (state << np.uint64(4)) | (self._wiring.motor_id[motor] & 0xF).astype(np.uint64)
        tail = np.full(len(error), temperature_c << 8 | temperature_c, np.uint64)
        data = self._codec.encode_replies(motor, first << np.uint64(56), report.values, tail)
        return Frames(self._wiring.channel[motor], self._reply_id[motor], data, self._length[motor])
