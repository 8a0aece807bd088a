"""moteus controllers in position mode, on CAN FD."""

import math

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers import moteus
from footfall.deploy.drivers.driver import CanFilter, Replies
from footfall.deploy.drivers.polled import Orders, PolledDriver
from footfall.deploy.drivers.settings import Limit, Settings
from footfall.deploy.frames import Frames, fd_bits
from footfall.deploy.wiring import Wiring

TURN = 2.0 * math.pi
TIMEOUT, UNEXPECTED_OFF = 200, 201  # error codes in addition to the maker's
ERRORS = moteus.FAULTS | {TIMEOUT: "that it has timed out", UNEXPECTED_OFF: "that it is disabled"}


class MoteusDriver(PolledDriver):
    """moteus driver. Each command contains the motor's timeout, and requests a reply."""

    maker = "moteus"
    models: tuple[str, ...] = (moteus.MODEL,)
    drive_limits: tuple[str, ...] = ("torque",)
    motor_end = "footfall.plant.motor_ends.moteus:MoteusMotorEnd"
    filters: tuple[CanFilter, ...] = tuple(
        {"can_id": moteus.HOST, "can_mask": 0xFF, "extended": extended, "fd": True}
        for extended in (False, True)
    )

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor id that does not fit into a frame, or without `drive_gains`."""
        n = len(wiring.motor_id)
        for joint, gains in zip(wiring.joint_names, wiring.drive_gains.tolist(), strict=True):
            if not all(gains):
                raise UserError(
                    f"joint {joint}: a moteus needs drive_gains, its servo.pid_position kp and kd"
                )
        self._identifier = moteus.to_motor(wiring.motor_id)
        rows, length = moteus.command_rows(wiring.timeout_s, wiring.highest)
        limit = Limit(moteus.TORQUE_LIMIT, "torque limit (register 0x025, N m)", wiring.highest)
        self._settings = Settings(wiring, {}, None, limit=limit)
        self._outgoing = Frames(wiring.channel, self._identifier, rows, np.full(n, length))
        stop, zero = (self._fixed(wiring, content) for content in (moteus.STOP, moteus.ZERO))
        super().__init__(wiring, Orders(self._outgoing, stop, zero, stop))
        gains = wiring.drive_gains.T / TURN  # N m/rad, N m s/rad
        self.highest = np.full((5, n), np.inf)  # a float has no limit below the motor's
        self.highest[2:4] = gains
        self.lowest = -self.highest
        self.lowest[2:4] = 0.0
        self.gain_rounding = 1e-7 * gains
        self.exchange_bits = np.full(n, fd_bits(length, True) + fd_bits(moteus.REPLY_LENGTH))
        self._mode, self._was_on = np.full(n, -1), np.zeros(n, bool)

    def _fixed(self, wiring: Wiring, content: bytes) -> Frames:
        data, length = moteus.padded(content, len(wiring.motor_id))
        return Frames(wiring.channel, self._identifier, data, np.full(len(data), length))

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        """All 11-bit identifiers: two nodes must not share one, independent of the kind of frame."""
        reply = motor_id << 8 | moteus.HOST
        return (reply,) if reply < 0x800 else ()

    @staticmethod
    def probes(motor_id: int) -> tuple[tuple[int, bytes], ...]:
        return ((int(moteus.to_motor(np.array(motor_id))), moteus.QUERY),)

    @staticmethod
    def senders(frames: Frames) -> np.ndarray:
        frames = frames.fd_frames()
        return np.where(_is_reply(frames), frames.id >> 8 & 0x7F, -1)

    def query_settings(self) -> Frames:
        """Reads of the torque limit if robot.yaml has one; a different limit is written before."""
        reads = self._settings.due_reads()
        rows = [moteus.padded(moteus.limit_access(each.write), 1) for each in reads]
        motor = np.array([each.motor for each in reads], np.intp)
        data = np.concatenate([data for data, _ in rows]) if rows else np.zeros((0, 64), np.uint8)
        length = np.array([length for _, length in rows], np.intp)
        return Frames(self._wiring.channel[motor], self._identifier[motor], data, length)

    def not_ready(self) -> str:
        return self._settings.problem()

    def not_enabled(self) -> str:
        off = self._mode != moteus.POSITION
        return (
            f"motor {self._wiring.label(int(off.argmax()))} does not confirm that it is enabled"
            if off.any()
            else ""
        )

    def disable(self) -> Frames:
        self._was_on[:] = False
        return self._orders.disable

    def not_confirmed_off(self) -> np.ndarray:
        return np.asarray((self._mode != moteus.STOPPED) & (self._mode != moteus.FAULT))

    def command(self, values: np.ndarray) -> Frames:
        if not math.isfinite(np.add.reduce(values, axis=None)):
            raise ValueError("a command that is not finite cannot be sent")
        position, velocity, kp, kd, torque = np.minimum(np.maximum(values, self.lowest), self.highest)
        floats = np.stack(
            [position / TURN, velocity / TURN, torque, kp / self.highest[2], kd / self.highest[3]], axis=1
        )
        data = self._outgoing.data.copy()
        data[:, moteus.FLOATS] = np.ascontiguousarray(floats.astype("<f4")).view(np.uint8)
        return self._outgoing._replace(data=data)

    def replies(self, frames: Frames) -> Replies:
        frames = frames.fd_frames()
        motor = self._lookup[frames.channel, frames.id >> 8 & 0x7F]
        to_host = (motor >= 0) & (frames.id & 0x80FF == moteus.HOST)
        for row in np.flatnonzero(to_host & (frames.length < moteus.REPLY_BYTES)).tolist():
            limit = moteus.reported_limit(frames.data[row, : frames.length[row]].tobytes())
            if limit is not None:
                self._settings.note(int(motor[row]), moteus.TORQUE_LIMIT, limit)
        usable = (motor >= 0) & _is_reply(frames)
        motor, frames = motor[usable], frames.take(usable)
        floats = np.ascontiguousarray(frames.data[:, 5:17]).view("<f4").astype(float).T
        usable = np.isfinite(floats).all(axis=0)
        motor, frames, (position, velocity, torque) = motor[usable], frames.take(usable), floats[:, usable]
        mode, fault = frames.data[:, 2].astype(int), frames.data[:, 21]
        error = np.where(mode == moteus.FAULT, np.maximum(fault, 1), 0)
        error[mode == moteus.TIMED_OUT] = TIMEOUT
        error[(mode == moteus.STOPPED) & self._was_on[motor]] = UNEXPECTED_OFF
        self._mode[motor] = mode
        self._was_on[motor] |= mode == moteus.POSITION
        voltage, temperature = frames.data[:, 19:21].view(np.int8).astype(float).T
        return Replies(
            motor,
            np.stack([position * TURN, velocity * TURN, torque]),
            error.astype(np.uint8),
            temperature,
            voltage * moteus.VOLTAGE_UNIT,
            frames.time_us,
        )

    def error_name(self, code: int, joint: int = 0) -> str:
        return ERRORS.get(code, f"fault {code}")


def _is_reply(frames: Frames) -> np.ndarray:
    """Frames of CAN FD that reply to `moteus.QUERY`, (k,) bool."""
    matches = (frames.id & 0x80FF == moteus.HOST) & (frames.length >= moteus.REPLY_BYTES)
    for index, byte in moteus.REPLY_HEADS.items():
        matches &= frames.data[:, index] == byte
    return np.asarray(matches)
