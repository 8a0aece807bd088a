"""RobStride motors in operation (MIT) mode.

Identifiers have 29 bits: `type << 24 | data << 8 | addressee`. A command (type 1) has its torque in the
identifier's 16 data bits, and position, velocity, stiffness and damping as four big-endian words. A reply
(type 2) has position, velocity, torque and temperature * 10; its data bits are the motor's id, six faults
and two bits of mode. A parameter (type 17) is read by its index, little-endian, in the first two bytes;
the reply has its value, little-endian, in the last four. Type 18 writes it until the motor loses power,
and gets a reply of type 2. The communication timeout is written if it is off or too long, and the torque
limit, a float, if robot.yaml has one.

A motor reports its faults (type 21) as a word of bits, little-endian, in the first four bytes. They apply to
its next replies until it reports others or is cleared. The last four bytes are warnings, which are ignored:
the supervisor has its own temperature limit.

Positions span 4 pi to either side, according to the manual; the maker's sample program has 12.5 rad, half a
per cent less.
"""

import math
import struct

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Motors, Replies
from footfall.deploy.drivers.mit import MotorRange
from footfall.deploy.drivers.polled import Orders, PolledDriver, to_every_motor
from footfall.deploy.drivers.settings import Known, Limit, Settings, Timeout
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.wiring import Wiring

HOST = 0xFD
CONTROL, FEEDBACK, ENABLE, STOP, ZERO, READ, WRITE, FAULT = 1, 2, 3, 4, 6, 17, 18, 21
TIMEOUT_STEP_S = 50e-6  # unit of the timeout: in the manual, 20000 is a second

_POSITION_RAD = 4 * math.pi
RANGES = {
    "RS00": MotorRange(33.0, 14.0, _POSITION_RAD),
    "RS01": MotorRange(44.0, 17.0, _POSITION_RAD),
    "RS02": MotorRange(44.0, 17.0, _POSITION_RAD),
    "RS03": MotorRange(20.0, 60.0, _POSITION_RAD, kp=5000.0, kd=100.0),
    "RS04": MotorRange(15.0, 120.0, _POSITION_RAD, kp=5000.0, kd=100.0),
    "RS05": MotorRange(50.0, 5.5, _POSITION_RAD),
    "RS06": MotorRange(50.0, 36.0, _POSITION_RAD, kp=5000.0, kd=100.0),
}

RUN_MODE, TORQUE_LIMIT, TIMEOUT = PARAMETERS = (0x7005, 0x700B, 0x7028)
_NAMES = {
    RUN_MODE: "run mode (parameter 0x7005)",
    TIMEOUT: "communication timeout (parameter 0x7028)",
}
RUNNING = 2  # mode in a reply; 0 is disabled, 1 calibrates

UNEXPECTED_OFF = 64  # bit for an enabled motor that reports disabled: it has rebooted, or timed out
FAULTS = {
    1: "under-voltage",
    2: "over-current",
    4: "over-temperature",
    8: "magnetic encoder fault",
    16: "stall overload",
    32: "that it is not calibrated",
    UNEXPECTED_OFF: "that it is disabled",
}

REPORTED = 128  # codes from here on: index of the lowest set bit in a report of type 21
REPORTED_FAULTS = {
    0: "over-temperature",
    1: "a fault of its driver chip",
    2: "under-voltage",
    3: "over-voltage",
    4: "over-current of phase B",
    5: "over-current of phase C",
    7: "that its encoder is not calibrated",
    8: "that its hardware identification failed",
    9: "that its position initialisation failed",
    14: "stall overload",
    16: "over-current of phase A",
}

_WORDS = np.dtype(">u2")
REPLY_ROWS = [0, 1, 4]  # rows of a `JointCommand` whose ranges a reply uses
_ALL = slice(None)


def identifier_of(kind: np.ndarray | int, data: np.ndarray | int, addressee: np.ndarray | int) -> np.ndarray:
    """Identifiers of frames of a type, with 16 bits of data, for one or more addressees."""
    return np.asarray(EXTENDED | np.asarray(kind) << 24 | np.asarray(data) << 8 | addressee)


class Codec:
    """Ranges of n motors. Both directions use 65535 intervals, rounded to nearest."""

    def __init__(self, models: tuple[str, ...]) -> None:
        rows = [RANGES[model] for model in models]
        self.highest = np.array([[r.position, r.velocity, r.kp, r.kd, r.torque] for r in rows]).T.copy()
        self.lowest = -self.highest
        self.lowest[2:4] = 0.0
        self.quantum = (self.highest - self.lowest) / 65535

    def codes(self, values: np.ndarray, rows: list[int], motor: Motors = _ALL) -> np.ndarray:
        """Codes (rows, k) from values (rows, k), clamped to the range; `rows` are those of a
        `JointCommand`."""
        lowest, highest, quantum = (
            part[rows][:, motor] for part in (self.lowest, self.highest, self.quantum)
        )
        return np.rint((np.minimum(np.maximum(values, lowest), highest) - lowest) / quantum).astype(np.intp)

    def values(self, codes: np.ndarray, rows: list[int], motor: Motors = _ALL) -> np.ndarray:
        """Values (rows, k) from codes (rows, k)."""
        return self.lowest[rows][:, motor] + codes * self.quantum[rows][:, motor]


def payload(words: np.ndarray) -> np.ndarray:
    """Four words for each of k frames, (4, k), as bytes (k, 8)."""
    return np.ascontiguousarray(words.T.astype(_WORDS)).view(np.uint8)


def words_of(data: np.ndarray) -> np.ndarray:
    """Bytes (k, 8) as four words for each frame, (4, k)."""
    return np.ascontiguousarray(data).view(_WORDS).astype(np.intp).T


def parameter_value(parameter: int, content: bytes) -> float:
    """Parameter from its four bytes: the run mode is a byte, the torque limit a float."""
    if parameter == TORQUE_LIMIT:
        return float(struct.unpack("<f", content)[0])
    return int.from_bytes(content[:1] if parameter == RUN_MODE else content, "little")


def parameter_bytes(parameter: int, value: float) -> bytes:
    """Inverse of `parameter_value`."""
    return struct.pack("<f", value) if parameter == TORQUE_LIMIT else int(value).to_bytes(4, "little")


class RobstrideDriver(PolledDriver):
    """RobStride driver."""

    maker = "RobStride"
    models = tuple(RANGES)
    drive_limits = ("torque",)
    motor_end = "footfall.plant.motor_ends.robstride:RobstrideMotorEnd"
    filters: tuple[CanFilter, ...] = tuple(
        {"can_id": kind << 24 | HOST, "can_mask": 0x1F00_00FF, "extended": True}
        for kind in (FEEDBACK, READ, FAULT)
    )

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor id that does not fit into a frame."""
        n = len(wiring.motor_id)
        zeros = to_every_motor(wiring)
        one = to_every_motor(wiring, np.tile(np.array([1, 0, 0, 0, 0, 0, 0, 0], np.uint8), (n, 1)))
        orders = ((zeros, ENABLE), (zeros, STOP), (one, ZERO), (one, STOP))
        super().__init__(
            wiring,
            Orders(*(each._replace(id=identifier_of(kind, HOST, wiring.motor_id)) for each, kind in orders)),
            extended=True,
        )
        self._codec = Codec(wiring.models)
        self.lowest, self.highest = self._codec.lowest, self._codec.highest
        self.gain_rounding = 0.5 * self._codec.quantum[2:4]
        limit = Limit(TORQUE_LIMIT, "torque limit (parameter 0x700b, N m)", wiring.highest)
        self._settings = Settings(wiring, _NAMES, Timeout(TIMEOUT, TIMEOUT_STEP_S), _problem, limit)
        self._was_on, self._is_on = np.zeros((2, n), dtype=bool)
        self._reported = np.zeros(n, np.uint8)  # codes of reported faults; 0 for none
        self._outgoing = zeros._replace(id=identifier_of(CONTROL, 0, wiring.motor_id))

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        """Empty: all identifiers have 29 bits."""
        return ()

    @staticmethod
    def probes(motor_id: int) -> tuple[tuple[int, bytes], ...]:
        return ((int(identifier_of(STOP, HOST, motor_id)), bytes(8)),)

    @staticmethod
    def senders(frames: Frames) -> np.ndarray:
        return np.where(_to_host(frames, FEEDBACK), frames.id >> 8 & 0xFF, -1)

    def query_settings(self) -> Frames:
        """Reads of unknown parameters; a wrong timeout or torque limit is written before."""
        rows = []
        for joint, parameter, value in self._settings.due_reads():
            if value is not None:
                content = parameter_bytes(parameter, value)
                rows.append((joint, WRITE, struct.pack("<HH", parameter, 0) + content))
            rows.append((joint, READ, struct.pack("<HHI", parameter, 0, 0)))
        joints = np.array([joint for joint, _, _ in rows], np.intp)
        kinds = np.array([kind for _, kind, _ in rows], np.intp)
        data = np.frombuffer(b"".join(row for _, _, row in rows), np.uint8).reshape(-1, 8)
        identifier = identifier_of(kinds, HOST, self._wiring.motor_id[joints])
        return Frames(self._wiring.channel[joints], identifier, data, np.full(len(rows), 8))

    def not_ready(self) -> str:
        return self._settings.problem()

    def not_confirmed_off(self) -> np.ndarray:
        return self._is_on.copy()

    def clear(self) -> Frames:
        self._reported[:] = 0
        return self._orders.clear

    def command(self, values: np.ndarray) -> Frames:
        if not math.isfinite(np.add.reduce(values, axis=None)):
            raise ValueError("a command that is not finite cannot be sent")
        codes = self._codec.codes(values, [0, 1, 2, 3, 4])
        return self._outgoing._replace(id=self._outgoing.id | codes[4] << 8, data=payload(codes[:4]))

    def replies(self, frames: Frames) -> Replies:
        motor = self._lookup[frames.channel, frames.id >> 8 & 0xFF]
        usable = (motor >= 0) & _to_host(frames, FEEDBACK)
        if not usable.all():
            self._note_other_frames(frames.take(~usable & (motor >= 0)))
            motor, frames = motor[usable], frames.take(usable)
        words = words_of(frames.data)
        values = self._codec.values(words[:3], REPLY_ROWS, motor)
        running = frames.id >> 22 & 3 == RUNNING
        error = (frames.id >> 16 & 0x3F).astype(np.uint8)
        error[~running & self._was_on[motor]] |= UNEXPECTED_OFF
        self._is_on[motor] = running
        self._was_on |= self._is_on
        reported = self._reported[motor]
        error = np.where(reported, reported, error)
        return Replies(motor, values, error, words[3] * 0.1, self._no_voltage[motor], frames.time_us)

    def _note_other_frames(self, frames: Frames) -> None:
        """Store parameters and reported faults."""
        motor = self._lookup[frames.channel, frames.id >> 8 & 0xFF]
        for kind, note in ((READ, self._note_parameter), (FAULT, self._note_faults)):
            rows = _to_host(frames, kind)
            for joint, row in zip(motor[rows].tolist(), frames.data[rows], strict=True):
                note(joint, row.tobytes())

    def _note_parameter(self, joint: int, row: bytes) -> None:
        parameter = int.from_bytes(row[:2], "little")
        if parameter in PARAMETERS:
            self._settings.note(joint, parameter, parameter_value(parameter, row[4:]))

    def _note_faults(self, joint: int, row: bytes) -> None:
        word = int.from_bytes(row[:4], "little")
        self._reported[joint] = REPORTED + lowest_bit(word) if word else 0

    def error_name(self, code: int, joint: int = 0) -> str:
        if code >= REPORTED:
            return REPORTED_FAULTS.get(code - REPORTED, f"fault bit {code - REPORTED}")
        names = [name for bit, name in FAULTS.items() if code & bit]
        return " and ".join(names) or f"error {code}"


def _to_host(frames: Frames, kind: int) -> np.ndarray:
    """Complete frames of a type for this host, (k,)."""
    addressed = (frames.id >= EXTENDED) & (frames.id & 0xFF == HOST) & (frames.length == 8)
    return np.asarray(addressed & (frames.id >> 24 & 0x1F == kind))


def lowest_bit(word: int) -> int:
    """Index of the lowest set bit in a word other than 0."""
    return (word & -word).bit_length() - 1


def _problem(known: Known) -> str:
    """Wrong setting of a motor; empty for none."""
    if known[RUN_MODE] != 0:
        return f"is in run mode {known[RUN_MODE]:g}: parameter {RUN_MODE:#06x} must be 0, operation mode"
    return ""
