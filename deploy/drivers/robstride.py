"""RobStride motors in operation (MIT) mode.

Identifiers have 29 bits: `type << 24 | data << 8 | addressee`. A command (type 1) carries its torque in the
identifier's 16 data bits, and position, velocity, stiffness and damping as four big-endian words. A reply
(type 2) carries position, velocity, torque and temperature * 10; its data bits are the motor's id, six faults
and two bits of mode. A parameter (type 17) is asked for by its index, little-endian, in the first two bytes,
and told with its value, little-endian, in the last four; type 18 writes it until the motor's power goes off,
and is answered by a reply. The communication time-out is set where it is off or too long.

A motor reports its faults (type 21) with a word of bits, little-endian, in the first four bytes; they are
told with its next replies until it reports others or is told to forget them. The last four bytes are
warnings: the supervisor has its own limit of the temperature.

Positions span 4 pi to either side, as the manual says; the maker's sample program has 12.5 rad, half a per
cent less.
"""

import math
import struct

import numpy as np

from footfall.deploy.drivers.driver import CanFilter, Motors, Replies, damping_alone
from footfall.deploy.drivers.mit import MotorRange
from footfall.deploy.drivers.mit_driver import motor_lookup
from footfall.deploy.drivers.settings import Settings
from footfall.deploy.frames import EXTENDED, Frames, frame_bits
from footfall.deploy.wiring import Wiring

HOST = 0xFD
CONTROL, FEEDBACK, ENABLE, STOP, ZERO, READ, WRITE, FAULT = 1, 2, 3, 4, 6, 17, 18, 21
TIME_OUT_STEP_S = 50e-6  # that the time-out is counted in: by the manual 20000 is a second

_TURNS = 4 * math.pi
RANGES = {
    "RS00": MotorRange(33.0, 14.0, _TURNS),
    "RS01": MotorRange(44.0, 17.0, _TURNS),
    "RS02": MotorRange(44.0, 17.0, _TURNS),
    "RS03": MotorRange(20.0, 60.0, _TURNS, kp=5000.0, kd=100.0),
    "RS04": MotorRange(15.0, 120.0, _TURNS, kp=5000.0, kd=100.0),
    "RS05": MotorRange(50.0, 5.5, _TURNS),
    "RS06": MotorRange(50.0, 36.0, _TURNS, kp=5000.0, kd=100.0),
}

RUN_MODE, TIME_OUT = PARAMETERS = (0x7005, 0x7028)
_NAMES = {RUN_MODE: "run mode", TIME_OUT: "communication time-out"}
RUNNING = 2  # of the modes in a reply; 0 is off, 1 calibrates

WENT_OFF = (
    64  # of a motor that was on, and says that it is off: it has rebooted, or heard nothing for too long
)
FAULTS = {
    1: "under-voltage",
    2: "over-current",
    4: "over-temperature",
    8: "magnetic encoder fault",
    16: "stall overload",
    32: "that it is not calibrated",
    WENT_OFF: "that it is switched off",
}

REPORTED = 128  # codes from here on are the numbers of bits in a report of type 21, its lowest one's
REPORTED_FAULTS = {
    0: "over-temperature",
    1: "a fault of its driver chip",
    2: "under-voltage",
    3: "over-voltage",
    4: "over-current of phase B",
    5: "over-current of phase C",
    7: "that its encoder is not calibrated",
    8: "that it does not know its own hardware",
    9: "that it cannot find its position",
    14: "stall overload",
    16: "over-current of phase A",
}

_WORDS = np.dtype(">u2")
REPLIED = [0, 1, 4]
_EVERYONE = slice(None)


def identifier_of(kind: np.ndarray | int, data: np.ndarray | int, addressee: np.ndarray | int) -> np.ndarray:
    """Identifiers of frames of a kind, with 16 bits of data, for one or more addressees."""
    return np.asarray(EXTENDED | np.asarray(kind) << 24 | np.asarray(data) << 8 | addressee)


class Codec:
    """The ranges of n motors. Both directions use 65535 intervals, rounded to nearest."""

    def __init__(self, models: tuple[str, ...]) -> None:
        rows = [RANGES[model] for model in models]
        self.highest = np.array([[r.position, r.velocity, r.kp, r.kd, r.torque] for r in rows]).T.copy()
        self.lowest = -self.highest
        self.lowest[2:4] = 0.0
        self.quantum = (self.highest - self.lowest) / 65535

    def codes(self, values: np.ndarray, rows: list[int], motor: Motors = _EVERYONE) -> np.ndarray:
        """Codes (rows, k) of values (rows, k), clamped to the range; `rows` are those of a `JointCommand`."""
        lowest, highest, quantum = (part[rows][:, motor] for part in self._parts)
        return np.rint((np.minimum(np.maximum(values, lowest), highest) - lowest) / quantum).astype(np.intp)

    def values(self, codes: np.ndarray, rows: list[int], motor: Motors = _EVERYONE) -> np.ndarray:
        """Values (rows, k) of codes (rows, k)."""
        lowest, _, quantum = (part[rows][:, motor] for part in self._parts)
        return lowest + codes * quantum

    @property
    def _parts(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.lowest, self.highest, self.quantum


def payload(words: np.ndarray) -> np.ndarray:
    """Four words for each of k frames, (4, k), as bytes (k, 8)."""
    return np.ascontiguousarray(words.T.astype(_WORDS)).view(np.uint8)


def words_of(data: np.ndarray) -> np.ndarray:
    """Bytes (k, 8) as four words for each frame, (4, k)."""
    return np.ascontiguousarray(data).view(_WORDS).astype(np.intp).T


def identifiers(motor: int) -> tuple[int, ...]:
    """No motor sends or hears an identifier of 11 bits."""
    return ()


class RobstrideDriver:
    """The controller's end."""

    identifiers = staticmethod(identifiers)
    filters: tuple[CanFilter, ...] = tuple(
        {"can_id": kind << 24 | HOST, "can_mask": 0x1F00_00FF, "extended": True}
        for kind in (FEEDBACK, READ, FAULT)
    )

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor id that a frame cannot carry."""
        n = len(wiring.motor_id)
        self._wiring, self._lookup = wiring, motor_lookup(wiring)
        self._codec = Codec(wiring.models)
        self.lowest, self.highest = self._codec.lowest, self._codec.highest
        self.gain_rounding = 0.5 * self._codec.quantum[2:4]
        self._speaks = np.zeros(n, bool)  # unasked: none does
        self._unknown = np.full(n, np.nan)  # no reply tells the voltage
        self.exchange_bits = np.full(n, 2 * frame_bits(8, extended=True, stuffed=False))
        self._settings = Settings(PARAMETERS, TIME_OUT, wiring.timeout_s, TIME_OUT_STEP_S)
        self._asking = True
        self._was_on = np.zeros(n, dtype=bool)
        self._reported = np.zeros(n, np.uint8)  # codes of reported faults, 0 for none
        self._control = identifier_of(CONTROL, 0, wiring.motor_id)
        nothing = Frames(wiring.channel, wiring.motor_id, np.zeros((n, 8), np.uint8), np.full(n, 8))
        self._outgoing = nothing
        self._enable = nothing._replace(id=identifier_of(ENABLE, HOST, wiring.motor_id))
        self._disable = nothing._replace(id=identifier_of(STOP, HOST, wiring.motor_id))
        one = np.tile(np.array([1, 0, 0, 0, 0, 0, 0, 0], np.uint8), (n, 1))
        self._clear = self._disable._replace(data=one)
        self._zero = Frames(wiring.channel, identifier_of(ZERO, HOST, wiring.motor_id), one, nothing.length)

    def query_settings(self) -> Frames:
        """Questions to motors that have not told all; a time-out that is wrong is written before."""
        rows = []
        for joint, parameter, value in self._settings.questions():
            if value is not None:
                rows.append((joint, WRITE, struct.pack("<HHI", parameter, 0, value)))
            rows.append((joint, READ, struct.pack("<HHI", parameter, 0, 0)))
        joints = np.array([joint for joint, _, _ in rows], np.intp)
        kinds = np.array([kind for _, kind, _ in rows], np.intp)
        data = np.frombuffer(b"".join(row for _, _, row in rows), np.uint8).reshape(-1, 8)
        identifier = identifier_of(kinds, HOST, self._wiring.motor_id[joints])
        return Frames(self._wiring.channel[joints], identifier, data, np.full(len(rows), 8))

    def not_ready(self) -> str:
        if not self._asking:
            return ""
        for joint, told in enumerate(self._settings.told):
            problem = _problem(told) or self._settings.time_out_problem(joint)
            if problem:
                return f"motor {self._wiring.place(joint)} {problem}"
        self._asking = False
        return ""

    def enable(self) -> Frames:
        return self._enable

    def not_enabled(self) -> str:
        return ""  # an answer is all that counts

    def disable(self) -> Frames:
        return self._disable

    def not_confirmed_off(self) -> np.ndarray:
        return self._speaks

    def clear(self) -> Frames:
        self._reported[:] = 0
        return self._clear

    def zero(self) -> Frames:
        return self._zero

    def command(self, values: np.ndarray) -> Frames:
        if not math.isfinite(np.add.reduce(values, axis=None)):
            raise ValueError("a command that is not finite cannot be sent")
        codes = self._codec.codes(values, [0, 1, 2, 3, 4])
        return self._outgoing._replace(id=self._control | codes[4] << 8, data=payload(codes[:4]))

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        return (self.command(damping_alone(kd)),)

    def replies(self, frames: Frames) -> Replies:
        kind, sender = frames.id >> 24 & 0x1F, frames.id >> 8 & 0xFF
        ours = (frames.id >= EXTENDED) & (frames.id & 0xFF == HOST) & (frames.length == 8)
        motor = self._lookup[frames.channel, sender]
        ours &= motor >= 0
        if self._asking:
            self._listen(frames.take(ours & (kind == READ)), motor[ours & (kind == READ)])
        usable = ours & (kind == FEEDBACK)
        if not usable.all():
            self._hear_faults(frames.data[ours & (kind == FAULT)], motor[ours & (kind == FAULT)])
            motor, frames = motor[usable], frames.take(usable)
        words = words_of(frames.data)
        values = self._codec.values(words[:3], REPLIED, motor)
        running = frames.id >> 22 & 3 == RUNNING
        error = (frames.id >> 16 & 0x3F).astype(np.uint8)
        error[~running & self._was_on[motor]] |= WENT_OFF
        self._was_on[motor] |= running
        reported = self._reported[motor]
        error = np.where(reported, reported, error)
        return Replies(motor, values, error, words[3] * 0.1, self._unknown[motor], frames.time_us)

    def _listen(self, frames: Frames, motor: np.ndarray) -> None:
        """Take in what motors tell."""
        for joint, row in zip(motor.tolist(), frames.data.tolist(), strict=True):
            parameter = row[0] | row[1] << 8
            if parameter in PARAMETERS:
                whole = row[4:5] if parameter == RUN_MODE else row[4:]  # the mode is a byte
                self._settings.hear(joint, parameter, int.from_bytes(bytes(whole), "little"))

    def _hear_faults(self, data: np.ndarray, motor: np.ndarray) -> None:
        """Take in reports of faults (k, 8)."""
        for joint, row in zip(motor.tolist(), data, strict=True):
            word = int.from_bytes(row[:4].tobytes(), "little")
            self._reported[joint] = REPORTED + lowest_bit(word) if word else 0

    def error_name(self, code: int, joint: int = 0) -> str:
        if code >= REPORTED:
            return REPORTED_FAULTS.get(code - REPORTED, f"fault bit {code - REPORTED}")
        names = [name for bit, name in FAULTS.items() if code & bit]
        return " and ".join(names) or f"error {code}"


def lowest_bit(word: int) -> int:
    """The number of the lowest bit that is set in a word other than 0."""
    return (word & -word).bit_length() - 1


def _problem(told: dict[int, float]) -> str:
    """What is missing, or wrong, of what a motor has told."""
    for parameter in PARAMETERS:
        if parameter not in told:
            return f"has not told its {_NAMES[parameter]} (parameter {parameter:#06x})"
    if told[RUN_MODE] != 0:
        return f"is in run mode {told[RUN_MODE]:g}: parameter {RUN_MODE:#06x} must be 0, operation mode"
    return ""
