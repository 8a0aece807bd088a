"""moteus controllers in position mode, on CAN FD."""

import struct
from typing import NamedTuple

import numpy as np

from footfall.deploy.drivers import moteus
from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.drivers.moteus_driver import TIMEOUT, TURN
from footfall.deploy.drivers.polled import motor_lookup
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import PolledMotorEnd, Report, Request, Requests

_COMMANDED = range(moteus.POSITION_COMMAND, moteus.POSITION_COMMAND + 5)
_DEFAULTS = 0.0, 0.0, 0.0, 1.0, 1.0  # values of registers that a command omits


class _LastBatch(NamedTuple):
    """The last batch of commands."""

    fixed: tuple[bytes, ...]  # identifiers, buses, and data without the numbers
    motor: np.ndarray  # (k,) indices
    kind: np.ndarray  # (k,) of `Request`


class MoteusMotorEnd(PolledMotorEnd):
    """Simulated moteus controllers. A motor that timed out, or has a fault, stays off until it is stopped."""

    filters: tuple[CanFilter, ...] = ({"can_id": 0x8000, "can_mask": 0x8080, "extended": True, "fd": True},)
    timeout_error = TIMEOUT
    timeout_latches = True

    def __init__(self, wiring: Wiring) -> None:
        super().__init__(wiring)
        n = len(wiring.motor_id)
        self._lookup, self._identifier = motor_lookup(wiring), moteus.from_motor(wiring.motor_id)
        self._gains = wiring.drive_gains.T / TURN
        self._data, length = moteus.padded(bytes(moteus.REPLY_BYTES), n)
        for index, byte in moteus.REPLY_HEADS.items():
            self._data[:, index] = byte
        self._length = np.full(n, length)
        self._timeout_s = np.full(n, 0.1)
        self.torque_limit = np.full(n, np.nan)
        self._last_batch = _LastBatch((), np.zeros(0, int), np.zeros(0, int))

    @property
    def timeout_s(self) -> np.ndarray:
        return self._timeout_s

    def settings_replies(self, frames: Frames) -> Frames | None:
        """Torque limits, `torque_limit` (n,) N m: NaN for the drive's own."""
        frames = frames.fd_frames()
        motor = self._lookup[frames.channel, frames.id & 0x7F]
        joints, rows = [], []
        for row in np.flatnonzero((motor >= 0) & (frames.id & 0x8080 == 0x8000)).tolist():
            try:
                parts = list(moteus.subframes(frames.data[row, : frames.length[row]].tobytes()))
            except ValueError:
                continue
            limit_subframes = [each for each in parts if each.first == moteus.TORQUE_LIMIT]
            for each in limit_subframes:
                if each.kind == moteus.WRITE:
                    self.torque_limit[motor[row]] = each.values[0]
            if any(each.kind == moteus.READ for each in limit_subframes):
                joints.append(motor[row])
                limit = struct.pack("<f", self.torque_limit[motor[row]])
                rows.append(moteus.padded(bytes([0x2D, moteus.TORQUE_LIMIT]) + limit, 1))
        if not rows:
            return None
        data = np.concatenate([data for data, _ in rows])
        length = np.array([length for _, length in rows])
        return Frames(self._wiring.channel[joints], self._identifier[joints], data, length)

    def requests(self, frames: Frames) -> Requests:
        """See `MotorEnd.requests`. Modes other than stop and position are ignored."""
        frames = frames.fd_frames()
        rest = np.delete(frames.data, moteus.FLOATS, 1).tobytes()
        fixed, last = (frames.id.tobytes(), frames.channel.tobytes(), rest), self._last_batch
        if fixed == last.fixed:  # only numbers differ: parsing takes 20 us a frame
            floats = np.ascontiguousarray(frames.data[:, moteus.FLOATS]).view("<f4").T
            return self._commands(last.motor, floats.astype(float), last.kind)
        motor = self._lookup[frames.channel, frames.id & 0x7F]
        rows: list[int] = []
        values: list[list[float]] = []
        kinds: list[Request] = []
        usable = (motor >= 0) & (frames.id & 0x8080 == 0x8000)
        for row in np.flatnonzero(usable).tolist():
            try:
                content = frames.data[row, : frames.length[row]].tobytes()
                written = _written(content)
            except ValueError:
                continue
            request_kind = self._kind(motor[row], written, moteus.QUERY in content)
            if request_kind is not None:
                rows.append(row)
                kinds.append(request_kind)
                values.append([written.get(each, _DEFAULTS[k]) for k, each in enumerate(_COMMANDED)])
        joints = motor[np.array(rows, np.intp)]
        numbers, kind = np.array(values, float).reshape(-1, 5).T, np.array(kinds, int)
        heads = frames.data[:, : len(moteus.COMMAND_HEAD)] == np.frombuffer(moteus.COMMAND_HEAD, np.uint8)
        if len(rows) == len(motor) and heads.all():
            self._last_batch = _LastBatch(fixed, joints, kind)
        return self._commands(joints, numbers, kind)

    def _commands(self, joints: np.ndarray, numbers: np.ndarray, kind: np.ndarray) -> Requests:
        """Requests of k frames that write these numbers, (5, k), to the registers of a command."""
        position, velocity, torque, kp, kd = numbers
        gains = self._gains[:, joints]
        command = np.array([position * TURN, velocity * TURN, kp * gains[0], kd * gains[1], torque])
        return Requests(joints, command, kind)

    def _kind(self, joint: int, written: dict[int, float], queried: bool) -> Request | None:
        """The request in a frame, or None; stores its timeout. `queried`: it ends with `moteus.QUERY`."""
        if moteus.OUTPUT_EXACT in written:
            return Request.ZERO
        if not written:
            return Request.READ if queried else None
        mode = written.get(moteus.MODE)
        if mode == moteus.STOPPED:
            return Request.STOP
        if mode != moteus.POSITION:
            return None
        if moteus.TIMEOUT in written:
            self._timeout_s[joint] = written[moteus.TIMEOUT] * moteus.TIMEOUT_UNIT_S
        return Request.RUN

    def reply(self, motor: Motors, report: Report) -> Frames:
        joints = np.arange(len(self._length))[motor]
        position, velocity, torque = report.values
        data = self._data[joints].copy()
        floats = np.stack([position / TURN, velocity / TURN, torque], axis=1).astype("<f4")
        data[:, 5:17] = np.ascontiguousarray(floats).view(np.uint8)
        fault = (report.error > 0) & (report.error != TIMEOUT)
        off = np.where(report.error == TIMEOUT, moteus.TIMED_OUT, moteus.STOPPED)
        data[:, 2] = np.where(fault, moteus.FAULT, np.where(report.on, moteus.POSITION, off))
        data[:, 19] = min(round(report.supply[0] / moteus.VOLTAGE_UNIT), 127)
        data[:, 20] = report.temperature_c
        data[:, 21] = np.where(fault, report.error, 0)
        return Frames(self._wiring.channel[joints], self._identifier[joints], data, self._length[joints])


def _written(data: bytes) -> dict[int, float]:
    """Numbers that a frame writes, by register.

    Raises:
        ValueError: another protocol, or a command in integers, which no driver here sends.
    """
    written: dict[int, float] = {}
    for subframe in moteus.subframes(data):
        registers = range(subframe.first, subframe.first + subframe.registers)
        if subframe.kind != moteus.WRITE:
            continue
        if subframe.form != "f" and subframe.first in _COMMANDED:
            raise ValueError("a command in integers")
        written.update(zip(registers, subframe.values, strict=True))
    return written
