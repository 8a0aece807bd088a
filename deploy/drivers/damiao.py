"""Damiao motors in MIT mode.

Commands are those of `mit.py`. A reply comes on the motor's host id (MST_ID, to be set to REPLY_ID + the
motor's id) and differs: byte 0 is `state << 4 | id`, byte 6 the temperature of the MOSFETs, byte 7 the
rotor's.

What the extreme codes mean are registers of the motor (PMAX, VMAX, TMAX), read before it is switched on. So
are its control mode, which has to be MIT, and its communication time-out, which is set where it is off or
too long. A register is asked for on 0x7FF by `id_low id_high 33 register 00 00 00 00`, and told on the host
id with its value, little-endian, in the last four bytes. `id_low id_high 55 register value` writes it until
the motor's power goes off, and is answered by the same bytes.

Answers about registers come on the identifier of the readings, where their bytes would mean a motor that is
off at one end of its range. They may be late: bytes 1 to 3 tell them from readings at any time.
"""

import struct
from dataclasses import replace

import numpy as np

from footfall.deploy.drivers import mit
from footfall.deploy.drivers.driver import CanFilter, Motors, Replies, damping_alone
from footfall.deploy.drivers.mit import MotorRange
from footfall.deploy.drivers.mit_driver import MOTOR_IDS, motor_lookup
from footfall.deploy.drivers.settings import Settings
from footfall.deploy.frames import Frames, frame_bits, same_layout
from footfall.deploy.wiring import Wiring

REPLY_ID = 0x200
REGISTER_ID = 0x7FF
READ, WRITE = 0x33, 0x55
TIME_OUT_STEP_S = 50e-6  # that the time-out is counted in, by public register tables; no motor was at hand

# As delivered, by the maker's table. What a motor says of itself counts.
RANGES = {
    "DM4310": MotorRange(30.0, 10.0),
    "DM4340": MotorRange(8.0, 28.0),
    "DM6006": MotorRange(45.0, 20.0),
    "DM8006": MotorRange(45.0, 40.0),
    "DM8009": MotorRange(45.0, 54.0),
    "DM10010": MotorRange(20.0, 200.0),
    "DM10010L": MotorRange(25.0, 200.0),
}

TIME_OUT, MODE, POSITION_MAX, VELOCITY_MAX, TORQUE_MAX = REGISTERS = (9, 10, 21, 22, 23)
_NAMES = {
    TIME_OUT: "communication time-out",
    MODE: "control mode",
    POSITION_MAX: "PMAX",
    VELOCITY_MAX: "VMAX",
    TORQUE_MAX: "TMAX",
}
WHOLE = (TIME_OUT, MODE)  # registers that are whole numbers; the others are floats
MIT_MODE = 1

OFF, ON = 0, 1  # states that are no faults
WENT_OFF = 16  # of a motor that was on, and says that it is off: it has rebooted
COMMUNICATION_LOST = 13
ERRORS = {
    5: "sensor error",
    6: "parameter error",
    8: "over-voltage",
    9: "under-voltage",
    10: "over-current",
    11: "over-temperature of its MOSFETs",
    12: "over-temperature of its coil",
    COMMUNICATION_LOST: "that it heard nothing for too long and switched itself off",
    14: "overload",
    WENT_OFF: "that it is switched off",
}

_EVERYONE = slice(None)
_ACCESS, _REGISTER = (np.isin(np.arange(256), codes) for codes in ((READ, WRITE), REGISTERS))  # by a byte


def identifiers(motor: int) -> tuple[int, ...]:
    """All that a motor alone sends or hears."""
    return motor, REPLY_ID + motor


class DamiaoDriver:
    """The controller's end."""

    identifiers = staticmethod(identifiers)
    filters: tuple[CanFilter, ...] = ({"can_id": REPLY_ID, "can_mask": 0x780, "extended": False},)

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor id that a frame cannot carry."""
        n = len(wiring.motor_id)
        self._wiring = wiring
        self._lookup = motor_lookup(wiring)
        self._everyone = np.arange(n)
        self._speaks = np.zeros(n, bool)  # unasked: none does
        self._unknown = np.full(n, np.nan)  # no reply tells the voltage
        self.exchange_bits = np.full(n, 2 * frame_bits(8, stuffed=False))
        self._ranges = [RANGES[model] for model in wiring.models]
        self._settings = Settings(REGISTERS, TIME_OUT, wiring.timeout_s, TIME_OUT_STEP_S)
        self._asking = True
        self._was_on = np.zeros(n, dtype=bool)
        self._outgoing = Frames(wiring.channel, wiring.motor_id, np.zeros((n, 8), np.uint8), np.full(n, 8))
        self._enable = self._outgoing._replace(data=mit.special(mit.ENTER, n))
        self._disable = self._outgoing._replace(data=mit.special(mit.EXIT, n))
        self._clear = self._outgoing._replace(data=mit.special(mit.CLEAR, n))
        self._zero = self._outgoing._replace(data=mit.special(mit.ZERO, n))
        self._usual = self._outgoing
        self._use(self._ranges)

    def _use(self, ranges: list[MotorRange]) -> None:
        self._codec = mit.Codec.of(ranges)
        self.lowest, self.highest = self._codec.lowest, self._codec.highest
        self.gain_rounding = 0.5 * self._codec.quantum[2:4]

    # -- settings ------------------------------------------------------------------------------------

    def query_settings(self) -> Frames:
        """Questions to motors that have not told all; a time-out that is wrong is written before."""
        rows = []
        for joint, register, value in self._settings.questions():
            motor = int(self._wiring.motor_id[joint])
            if value is not None:
                rows.append((joint, struct.pack("<HBBI", motor, WRITE, register, value)))
            rows.append((joint, struct.pack("<HBBI", motor, READ, register, 0)))
        channel = self._wiring.channel[np.array([joint for joint, _ in rows], np.intp)]
        data = np.frombuffer(b"".join(row for _, row in rows), np.uint8).reshape(-1, 8)
        return Frames(channel, np.full(len(rows), REGISTER_ID), data, np.full(len(rows), 8))

    def not_ready(self) -> str:
        if not self._asking:
            return ""
        for joint, told in enumerate(self._settings.told):
            problem = _problem(told) or self._settings.time_out_problem(joint)
            if problem:
                return f"motor {self._wiring.place(joint)} {problem}"
        self._use(
            [
                replace(
                    usual, position=told[POSITION_MAX], velocity=told[VELOCITY_MAX], torque=told[TORQUE_MAX]
                )
                for usual, told in zip(self._ranges, self._settings.told, strict=True)
            ]
        )
        self._asking = False
        return ""

    def _listen(self, data: np.ndarray, motor: np.ndarray) -> None:
        """Take in what motors tell of their registers; the echo of a write proves nothing."""
        for row in np.flatnonzero(data[:, 2] == READ):
            register = int(data[row, 3])
            (value,) = struct.unpack("<I" if register in WHOLE else "<f", data[row, 4:].tobytes())
            self._settings.hear(int(motor[row]), register, value)

    # -- every tick ----------------------------------------------------------------------------------

    def enable(self) -> Frames:
        return self._enable

    def not_enabled(self) -> str:
        return ""  # an answer is all that counts

    def disable(self) -> Frames:
        return self._disable

    def not_confirmed_off(self) -> np.ndarray:
        return self._speaks

    def clear(self) -> Frames:
        return self._clear

    def zero(self) -> Frames:
        return self._zero

    def command(self, values: np.ndarray) -> Frames:
        return self._outgoing._replace(data=self._codec.encode(values))

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        return (self.command(damping_alone(kd)),)

    def replies(self, frames: Frames) -> Replies:
        about_registers = _about_registers(frames.data)
        if same_layout(frames, self._usual) and not np.count_nonzero(about_registers):
            return self._decoded(frames, _EVERYONE)
        sender = frames.id - REPLY_ID
        usable = (sender > 0) & (sender <= MOTOR_IDS[-1]) & (frames.length == 8)
        motor = self._lookup[frames.channel, np.where(usable, sender, 0)]
        usable &= motor >= 0
        usable[usable] = (frames.data[usable, 0] & 0xF) == (sender[usable] & 0xF)
        told = usable & about_registers
        self._listen(frames.data[told], motor[told])
        usable &= ~about_registers
        if np.array_equal(motor, self._everyone) and usable.all():
            self._usual = frames
        return self._decoded(frames.take(usable), motor[usable])

    def _decoded(self, frames: Frames, motor: Motors) -> Replies:
        data = frames.data
        values = self._codec.decode_replies(data, motor).values
        state = data[:, 0] >> 4
        error = np.where(state > ON, state, 0).astype(np.uint8)
        error[(state == OFF) & self._was_on[motor]] = WENT_OFF
        self._was_on[motor] |= state == ON
        temperature = np.maximum(data[:, 6], data[:, 7]).astype(float)
        return Replies(motor, values, error, temperature, self._unknown[motor], frames.time_us)

    def error_name(self, code: int, joint: int = 0) -> str:
        return ERRORS.get(code, f"error {code}")


def _about_registers(data: np.ndarray) -> np.ndarray:
    """Which frames (k, 8) tell or confirm a register: no reading that a joint could have looks like that."""
    return (data[:, 1] == 0) & _ACCESS[data[:, 2]] & _REGISTER[data[:, 3]]


def _problem(told: dict[int, float]) -> str:
    """What is missing, or wrong, of what a motor has told."""
    for register in REGISTERS:
        if register not in told:
            return f"has not told its {_NAMES[register]} (register {register})"
    if told[MODE] != MIT_MODE:
        return f"is in control mode {told[MODE]:g}: register {MODE} must be {MIT_MODE}, MIT mode"
    for register in (POSITION_MAX, VELOCITY_MAX, TORQUE_MAX):
        if not 0.0 < told[register] < 1e4:
            return f"says that its {_NAMES[register]} is {told[register]:g} (register {register})"
    return ""
