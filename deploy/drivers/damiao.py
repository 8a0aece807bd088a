"""Damiao motors in MIT mode.

Commands are those of `mit.py`. A reply has the motor's host id (MST_ID, to be set to REPLY_ID + the motor's
id) and a different content: byte 0 is `state << 4 | id`, byte 6 the temperature of the MOSFETs, byte 7 that
of the rotor.

The ranges of the codes are registers of the motor (PMAX, VMAX, TMAX), read before it is enabled. Its control
mode, which must be MIT, and its communication timeout are read, too. The timeout is written if it is off or
too long.
`id_low id_high 33 register 00 00 00 00` on 0x7FF reads a register. The reply has the host id, and the value
in the last four bytes, little-endian. `id_low id_high 55 register value` writes it until the motor loses
power; the reply has the same bytes.

A reply on a register has the same identifier as a reading. Decoded as a reading, it would be a disabled motor
at one end of its range. Such a reply may be late: bytes 1 to 3 distinguish it from a reading at any time.
"""

import struct
from dataclasses import replace

import numpy as np

from footfall.deploy.drivers import mit
from footfall.deploy.drivers.driver import CanFilter, Motors, Replies
from footfall.deploy.drivers.mit import MotorRange
from footfall.deploy.drivers.polled import MOTOR_IDS, Orders, PolledDriver, to_every_motor
from footfall.deploy.drivers.settings import Known, Settings, Timeout
from footfall.deploy.frames import Frames, Layout, layout_of
from footfall.deploy.wiring import Wiring

REPLY_ID = 0x200
REGISTER_ID = 0x7FF
READ, WRITE = 0x33, 0x55
TIMEOUT_STEP_S = 50e-6  # unit of the timeout in public register tables; not measured on a motor

# Factory settings in the maker's table. A motor's own registers take precedence.
RANGES = {
    "DM4310": MotorRange(30.0, 10.0),
    "DM4340": MotorRange(8.0, 28.0),
    "DM6006": MotorRange(45.0, 20.0),
    "DM8006": MotorRange(45.0, 40.0),
    "DM8009": MotorRange(45.0, 54.0),
    "DM10010": MotorRange(20.0, 200.0),
    "DM10010L": MotorRange(25.0, 200.0),
}

TIMEOUT, MODE, POSITION_MAX, VELOCITY_MAX, TORQUE_MAX = REGISTERS = (9, 10, 21, 22, 23)
_NAMES = {
    TIMEOUT: "communication timeout (register 9)",
    MODE: "control mode (register 10)",
    POSITION_MAX: "PMAX (register 21)",
    VELOCITY_MAX: "VMAX (register 22)",
    TORQUE_MAX: "TMAX (register 23)",
}
INTEGERS = (TIMEOUT, MODE)  # integer registers; the others are floats
MIT_MODE = 1

OFF, ON = 0, 1  # states that are not faults
UNEXPECTED_OFF = 16  # error code for an enabled motor that reports disabled: it has rebooted
COMMUNICATION_LOST = 13
ERRORS = {
    5: "sensor error",
    6: "parameter error",
    8: "over-voltage",
    9: "under-voltage",
    10: "over-current",
    11: "over-temperature of its MOSFETs",
    12: "over-temperature of its coil",
    COMMUNICATION_LOST: "a communication timeout, and is disabled",
    14: "overload",
    UNEXPECTED_OFF: "that it is disabled",
}

_ALL = slice(None)
_IS_ACCESS, _IS_REGISTER = (np.isin(np.arange(256), codes) for codes in ((READ, WRITE), REGISTERS))  # by byte


class DamiaoDriver(PolledDriver):
    """Damiao driver."""

    maker = "Damiao"
    models = tuple(RANGES)
    motor_end = "footfall.plant.motor_ends.damiao:DamiaoMotorEnd"
    filters: tuple[CanFilter, ...] = ({"can_id": REPLY_ID, "can_mask": 0x780, "extended": False},)

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor id that does not fit into a frame."""
        n = len(wiring.motor_id)
        orders = (mit.special(word, n) for word in (mit.ENTER, mit.EXIT, mit.ZERO, mit.CLEAR))
        super().__init__(wiring, Orders(*(to_every_motor(wiring, data) for data in orders)))
        self._settings = Settings(wiring, _NAMES, Timeout(TIMEOUT, TIMEOUT_STEP_S), _problem)
        self._ranges = [RANGES[model] for model in wiring.models]
        self._was_on, self._is_on = np.zeros((2, n), dtype=bool)
        self._outgoing = to_every_motor(wiring)
        self._last_layout: Layout | None = None  # layout of the last batch with all motors in joint order
        self._use_ranges(self._ranges)

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        return motor_id, REPLY_ID + motor_id

    @staticmethod
    def probes(motor_id: int) -> tuple[tuple[int, bytes], ...]:
        return ((motor_id, mit.special(mit.EXIT, 1).tobytes()),)

    @staticmethod
    def senders(frames: Frames) -> np.ndarray:
        sender = frames.id - REPLY_ID
        usable = (sender > 0) & (sender <= MOTOR_IDS[-1]) & (frames.length == 8)
        usable &= (frames.data[:, 0] & 0xF) == (sender & 0xF)
        return np.where(usable, sender, -1)

    def _use_ranges(self, ranges: list[MotorRange]) -> None:
        self._codec = mit.Codec.of(ranges)
        self.lowest, self.highest = self._codec.lowest, self._codec.highest
        self.gain_rounding = 0.5 * self._codec.quantum[2:4]

    def query_settings(self) -> Frames:
        """Frames that read unknown registers; a wrong timeout is written before."""
        rows = []
        for joint, register, value in self._settings.due_reads():
            motor = int(self._wiring.motor_id[joint])
            if value is not None:
                rows.append((joint, struct.pack("<HBBI", motor, WRITE, register, int(value))))
            rows.append((joint, struct.pack("<HBBI", motor, READ, register, 0)))
        channel = self._wiring.channel[np.array([joint for joint, _ in rows], np.intp)]
        data = np.frombuffer(b"".join(row for _, row in rows), np.uint8).reshape(-1, 8)
        return Frames(channel, np.full(len(rows), REGISTER_ID), data, np.full(len(rows), 8))

    def not_ready(self) -> str:
        return self._settings.problem()

    def not_confirmed_off(self) -> np.ndarray:
        return self._is_on.copy()

    def _note_registers(self, data: np.ndarray, motor: np.ndarray) -> None:
        """Store reported registers until all are right; the echo of a write is not a confirmation."""
        if not self._settings.problem():
            return
        for joint, row in zip(motor.tolist(), data, strict=True):
            if row[2] == READ:
                register = int(row[3])
                (value,) = struct.unpack("<I" if register in INTEGERS else "<f", row[4:].tobytes())
                self._settings.note(joint, register, value)
        if not self._settings.problem():
            self._use_ranges(
                [
                    replace(
                        factory,
                        position=known[POSITION_MAX],
                        velocity=known[VELOCITY_MAX],
                        torque=known[TORQUE_MAX],
                    )
                    for factory, known in zip(self._ranges, self._settings.known, strict=True)
                ]
            )

    def command(self, values: np.ndarray) -> Frames:
        return self._outgoing._replace(data=self._codec.encode(values))

    def replies(self, frames: Frames) -> Replies:
        about_registers = _about_registers(frames.data)
        if layout_of(frames) == self._last_layout and not np.count_nonzero(about_registers):
            return self._decoded(frames, _ALL)
        sender = self.senders(frames)
        motor = self._lookup[frames.channel, sender]
        usable = (motor >= 0) & (sender >= 0)
        register_frames = usable & about_registers
        if np.count_nonzero(register_frames):
            self._note_registers(frames.data[register_frames], motor[register_frames])
        usable &= ~about_registers
        if usable.all() and np.array_equal(motor, np.arange(len(self._was_on))):
            self._last_layout = layout_of(frames)
        return self._decoded(frames.take(usable), motor[usable])

    def _decoded(self, frames: Frames, motor: Motors) -> Replies:
        data = frames.data
        values = self._codec.decode_replies(data, motor).values
        state = data[:, 0] >> 4
        error = np.where(state > ON, state, 0).astype(np.uint8)
        error[(state == OFF) & self._was_on[motor]] = UNEXPECTED_OFF
        self._is_on[motor] = state == ON
        self._was_on |= self._is_on
        temperature = np.maximum(data[:, 6], data[:, 7]).astype(float)
        return Replies(motor, values, error, temperature, self._no_voltage[motor], frames.time_us)

    def error_name(self, code: int, joint: int = 0) -> str:
        return ERRORS.get(code, f"error {code}")


def _about_registers(data: np.ndarray) -> np.ndarray:
    """Frames (k, 8) that report or confirm a register: no possible reading has these bytes."""
    return (data[:, 1] == 0) & _IS_ACCESS[data[:, 2]] & _IS_REGISTER[data[:, 3]]


def _problem(known: Known) -> str:
    """Wrong setting of a motor; empty for none."""
    if known[MODE] != MIT_MODE:
        return f"is in control mode {known[MODE]:g}: register {MODE} must be {MIT_MODE}, MIT mode"
    for register in (POSITION_MAX, VELOCITY_MAX, TORQUE_MAX):
        if not 0.0 < known[register] < 1e4:
            return f"has {known[register]:g} as its {_NAMES[register]}"
    return ""
