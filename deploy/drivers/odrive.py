"""ODrive's CANSimple protocol: the joint law is closed on the host, and a frame carries a torque alone.

Identifiers have 11 bits, `node << 5 | message`; numbers are little-endian. As of firmware 0.6:

| message | who sends it | content |
| --- | --- | --- |
| 0x01 heartbeat | axis, every 100 ms | active errors u32, state u8, result u8, trajectory done u8 |
| 0x04 read or write | host | 0 to read, u8; endpoint u16; 0 u8 |
| 0x05 was read | axis, when asked | 0 u8; endpoint u16; 0 u8; value |
| 0x07 axis state | host | u32: 1 off, 8 closed loop |
| 0x09 encoder | axis, as often as it is set to | position f32, velocity f32: turns and turns/s of the rotor |
| 0x0B controller mode | host | control u32 (1 torque, 2 velocity), input u32 (1 passed through) |
| 0x0D input velocity | host | f32, turns/s of the rotor; f32, N m at the rotor on top |
| 0x0E input torque | host | f32, N m at the rotor |
| 0x15 temperature | axis | f32 of its power stage, f32 of the motor |
| 0x17 supply | axis | f32 V, f32 A |
| 0x18 clear errors | host | |
| 0x19 absolute position | host | f32, turns |
| 0x1B velocity gains | host | f32, N m/(turn/s) at the rotor; f32, of the integral |
| 0x1C torques | axis, as often as it is set to | target f32, estimate f32: N m at the rotor |

Nothing but a read is answered: an axis sends what it measures by itself. `encoder_msg_rate_ms` and
`torques_msg_rate_ms` have to be set to a joint tick, and its watchdog, which is off by default, has to be
switched on, at `timeout_s` of robot.yaml or less. That is read before an axis is switched on, where
robot.yaml has its `watchdog_endpoints`: which endpoint is which differs from firmware to firmware, and is in
the `flat_endpoints.json` of each.
"""

import math

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers.driver import CanFilter, Replies
from footfall.deploy.frames import Frames, frame_bits, joined
from footfall.deploy.wiring import Wiring

MODEL = "ODrive"
NODES = range(1, 63)  # 63 is everybody

HEARTBEAT, READ, WAS_READ, STATE, ENCODER, MODE, TORQUE = 0x01, 0x04, 0x05, 0x07, 0x09, 0x0B, 0x0E
VELOCITY, GAINS = 0x0D, 0x1B
TEMPERATURE, SUPPLY, CLEAR, POSITION, TORQUES = 0x15, 0x17, 0x18, 0x19, 0x1C
IDLE, CLOSED_LOOP = 1, 8
TORQUE_CONTROL, VELOCITY_CONTROL = (1, 1), (2, 1)  # control mode and input mode

# Codes: the number of the lowest bit that is set, plus one; these two are found out on the host.
NOT_ON, NO_TORQUES = 40, 41
WATCHDOG = 25
ERRORS = {
    1: "that it is initializing",
    2: "a system error",
    3: "a timing error",
    4: "that it lacks an estimate",
    5: "a bad configuration",
    6: "a fault of its gate driver",
    7: "that it lacks an input",
    9: "over-voltage",
    10: "under-voltage",
    11: "over-current of its supply",
    12: "too much current fed back",
    13: "that its current went beyond the limit",
    14: "over-temperature of its motor",
    15: "over-temperature of its power stage",
    16: "that its speed went beyond the limit",
    17: "that its position went beyond the limit",
    WATCHDOG: "that it heard nothing for too long and switched itself off",
    26: "that it was asked for an emergency stop",
    27: "that its encoder slips",
    28: "that its brake resistor is off",
    29: "that its thermistor is gone",
    31: "that it is not calibrated",
    NOT_ON: "that it is switched off",
    NO_TORQUES: "no torque (set torques_msg_rate_ms)",
}

TURN = 2 * math.pi
# A torque that was worked out from a reading is right for a moment only: readings that are older than this
# many commands make none, and so many readings may come without a torque.
OLDEST_READING = 5
ENABLE_EVERY = 100  # ticks; longer than a heartbeat takes to say that an axis is on
MOST_WITHOUT_TORQUE = 25

_FLOATS = np.dtype("<f4")
_WORDS = np.dtype("<u4")
_SHORTS = np.dtype("<u2")


def identifiers(node: int) -> tuple[int, ...]:
    """All that an axis sends or hears."""
    return tuple(range(node << 5, (node + 1) << 5))


def node_lookup(wiring: Wiring) -> np.ndarray:
    """Joint index of a node on a bus, -1 for none: (buses, 64). Raises UserError for a node that is none."""
    for joint, node in zip(wiring.joint_names, wiring.motor_id.tolist(), strict=True):
        if node not in NODES:
            raise UserError(f"joint {joint} has motor id {node}: an ODrive takes {NODES[0]} to {NODES[-1]}")
    lookup = np.full((len(wiring.buses), 64), -1)
    lookup[wiring.channel, wiring.motor_id] = np.arange(len(wiring.motor_id))
    return lookup


def floats(data: np.ndarray) -> np.ndarray:
    """The two numbers in each of k frames (k, 8), as (2, k)."""
    with np.errstate(invalid="ignore"):  # other makers' frames are looked at, too, and hold anything
        return np.ascontiguousarray(data).view(_FLOATS).T.astype(float)


def error_code(bits: np.ndarray) -> np.ndarray:
    """Codes (k,) of words of error bits (k,): the lowest bit's number plus one, 0 for none."""
    word = bits.astype(np.int64)
    lowest = word & -word
    return np.where(word == 0, 0, np.log2(np.maximum(lowest, 1)).astype(np.int64) + 1)


class OdriveDriver:
    """The controller's end. It closes the joint law itself, on the latest readings."""

    identifiers = staticmethod(identifiers)
    filters: tuple[CanFilter, ...] = tuple(
        {"can_id": message, "can_mask": 0x1F, "extended": False}
        for message in (HEARTBEAT, WAS_READ, ENCODER, TEMPERATURE, SUPPLY, TORQUES)
    )

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a node id that is none."""
        n = len(wiring.motor_id)
        self._wiring, self._lookup = wiring, node_lookup(wiring)
        self._node = wiring.motor_id << 5
        self._watchdog = np.full((2, n), np.nan)  # whether it is on, and its time, s; NaN until told
        self._endpoints = wiring.watchdog_endpoints.T  # (2, n), 0 where not given
        self._per_turn = TURN / wiring.gear_ratio  # rad at the joint
        self._gear = wiring.gear_ratio
        self.highest = np.full((5, n), np.inf)  # a float carries whatever the motor can do
        self.lowest = -self.highest
        self.lowest[2:4] = 0.0
        self.gain_rounding = np.zeros((2, n))  # gains stay on the host
        self.exchange_bits = np.full(n, frame_bits(4, stuffed=False) + 2 * frame_bits(8, stuffed=False))
        self._values = np.zeros((3, n))
        self._age = np.full(n, OLDEST_READING)  # commands since the last reading
        self._without_torque = np.full(n, MOST_WITHOUT_TORQUE)  # readings since the last torque
        self._state = np.zeros(n, np.uint8)
        self._was_on, self._tellings = np.zeros(n, bool), 0
        self._error = np.zeros(n, np.intp)
        self._temperature, self._voltage = np.full((2, n), np.nan)
        self._torque = self._frames(TORQUE, 4, np.zeros((n, 8), np.uint8))
        self._mode = self._frames(MODE, 8, _words(n, *TORQUE_CONTROL))
        self._enable = self._frames(STATE, 4, _words(n, CLOSED_LOOP, 0))
        self._disable = self._frames(STATE, 4, _words(n, IDLE, 0))
        self._clear = self._frames(CLEAR, 0, np.zeros((n, 8), np.uint8))
        self._zero = self._frames(POSITION, 4, np.zeros((n, 8), np.uint8))

    def _frames(self, message: int, length: int, data: np.ndarray) -> Frames:
        n = len(self._node)
        return Frames(self._wiring.channel, self._node | message, data, np.full(n, length))

    def query_settings(self) -> Frames:
        """Torque control, and reading what is not known of the watchdogs, one endpoint at a time."""
        untold = np.isnan(self._watchdog) & (self._endpoints > 0)
        axes = np.flatnonzero(untold.any(axis=0))
        if not axes.size:
            return self._mode
        data = np.zeros((len(axes), 8), np.uint8)
        data[:, 1:3] = _pairs(self._endpoints[untold[:, axes].argmax(axis=0), axes])
        reads = Frames(self._wiring.channel[axes], self._node[axes] | READ, data, np.full(len(axes), 4))
        return joined([self._mode, reads])

    def not_ready(self) -> str:
        for missing, what in (
            (self._age >= OLDEST_READING, "sends no position (set encoder_msg_rate_ms to a joint tick)"),
            (self._without_torque >= MOST_WITHOUT_TORQUE, "sends no torque (set torques_msg_rate_ms)"),
            (self._state == 0, "sends no heartbeat (set heartbeat_msg_rate_ms)"),
        ):
            if missing.any():
                return f"motor {self._wiring.place(int(missing.argmax()))} {what}"
        return self._unwatched()

    def _unwatched(self) -> str:
        """Which axis may not be switched on since its watchdog is not known to be right, and why."""
        longest_s, given = self._wiring.timeout_s, self._endpoints[0] > 0
        on, waits_s = self._watchdog
        for wrong, what in (
            (np.isnan(on + waits_s), "has not told its watchdog: has its firmware other watchdog_endpoints?"),
            (on == 0.0, "has its watchdog off (set enable_watchdog)"),
            (
                ~_within(waits_s, longest_s),
                "has a watchdog of {0:g} s (set watchdog_timeout to {1:g})",
            ),
        ):
            if (wrong & given).any():
                joint = int((wrong & given).argmax())
                return f"motor {self._wiring.place(joint)} {what.format(waits_s[joint], longest_s[joint])}"
        return ""

    def enable(self) -> Frames:
        """An axis that is told to switch on while it is on starts anew: it is told now and then only."""
        tell = self._tellings % ENABLE_EVERY == 0
        self._tellings += 1
        return self._enable if tell else self._mode

    def not_enabled(self) -> str:
        off = self._state != CLOSED_LOOP
        return f"motor {self._wiring.place(int(off.argmax()))} does not switch on" if off.any() else ""

    def disable(self) -> Frames:
        self._was_on[:], self._tellings = False, 0
        return self._disable

    def not_confirmed_off(self) -> np.ndarray:
        """An axis sends its readings whether it is on or off: its heartbeat tells."""
        return (self._state == 0) | (self._state == CLOSED_LOOP)

    def clear(self) -> Frames:
        return self._clear

    def zero(self) -> Frames:
        return self._zero

    def command(self, values: np.ndarray) -> Frames:
        """The torque of the PD law (`robots/actuator.py`) at the latest reading; none where that is old."""
        position, velocity, _ = self._values
        torque = values[2] * (values[0] - position) + values[3] * (values[1] - velocity) + values[4]
        if not math.isfinite(np.add.reduce(values, axis=None)) or not np.isfinite(torque).all():
            raise ValueError("a command that is not finite cannot be sent")
        torque[self._age >= OLDEST_READING] = 0.0
        self._age += 1
        data = np.zeros((len(torque), 8), np.uint8)
        data[:, :4] = (torque / self._gear).astype(_FLOATS).view(np.uint8).reshape(-1, 4)
        return self._torque._replace(data=data)

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        """No velocity, in velocity control: an axis closes that law itself, without a reading of the host's.

        The first of them removes the last torque. `query_settings` and `enable` return to torque control.
        """
        n = len(self._node)
        gain = np.zeros((n, 2), _FLOATS)
        gain[:, 0] = kd * TURN / self._gear**2
        return (
            self._frames(VELOCITY, 8, np.zeros((n, 8), np.uint8)),
            self._frames(GAINS, 8, gain.view(np.uint8)),
            self._frames(MODE, 8, _words(n, *VELOCITY_CONTROL)),
        )

    def replies(self, frames: Frames) -> Replies:
        """A reply is an axis' position and velocity, with what it told of the rest before."""
        message = frames.id & 0x1F
        node = np.where(frames.id < 0x800, frames.id >> 5, 0)
        motor = self._lookup[frames.channel, node]
        ours = (motor >= 0) & ((frames.length == 8) | (message == WAS_READ) & (frames.length > 4))
        if not ours.all():
            frames, motor, message = frames.take(ours), motor[ours], message[ours]
        first, second = floats(frames.data)
        finite = np.isfinite(first) & np.isfinite(second)
        encoder = (message == ENCODER) & finite
        rest = ~encoder
        if rest.any():
            self._listen(
                message[rest], motor[rest], frames.data[rest], first[rest], second[rest], finite[rest]
            )
        motor = motor[encoder]
        self._values[:2, motor] = first[encoder], second[encoder]
        self._values[:2, motor] *= self._per_turn[motor]
        self._age[motor] = 0
        self._without_torque[motor] += 1
        error = self._error[motor]
        error[(error == 0) & (self._without_torque[motor] > MOST_WITHOUT_TORQUE)] = NO_TORQUES
        time_us = None if frames.time_us is None else frames.time_us[encoder]
        return Replies(
            motor,
            self._values[:, motor],
            error.astype(np.uint8),
            self._temperature[motor],
            self._voltage[motor],
            time_us,
        )

    def _listen(
        self,
        message: np.ndarray,
        motor: np.ndarray,
        data: np.ndarray,
        first: np.ndarray,
        second: np.ndarray,
        finite: np.ndarray,
    ) -> None:
        """Take in what axes tell beside their positions."""
        for kind in set(message.tolist()):
            rows = message == kind
            who = motor[rows]
            if kind == HEARTBEAT:
                self._hear_heartbeats(who, data[rows])
                continue
            if kind == WAS_READ:
                self._hear_reads(who, data[rows], second[rows])
                continue
            rows &= finite
            who = motor[rows]
            if kind == TORQUES:
                self._values[2, who] = second[rows] * self._gear[who]
                self._without_torque[who] = 0
            elif kind == TEMPERATURE:
                self._temperature[who] = np.maximum(first[rows], second[rows])
            elif kind == SUPPLY:
                self._voltage[who] = first[rows]

    def _hear_heartbeats(self, motor: np.ndarray, data: np.ndarray) -> None:
        """An axis that was on and says that it is off is at fault."""
        state = data[:, 4]
        on = state == CLOSED_LOOP
        self._state[motor] = state
        error = error_code(np.ascontiguousarray(data[:, :4]).view(_WORDS)[:, 0])
        self._error[motor] = np.where((error == 0) & ~on & self._was_on[motor], NOT_ON, error)
        self._was_on[motor] |= on & (self._tellings > 0)

    def _hear_reads(self, motor: np.ndarray, data: np.ndarray, number: np.ndarray) -> None:
        """What k axes were asked for, (k, 8): a switch in byte 4, or a `number` (k,) in bytes 4 to 7."""
        endpoint = np.ascontiguousarray(data[:, 1:3]).view(_SHORTS)[:, 0]
        switch, time = ((endpoint > 0) & (endpoint == self._endpoints[which, motor]) for which in (0, 1))
        self._watchdog[0, motor[switch]] = data[switch, 4] != 0
        self._watchdog[1, motor[time]] = number[time]

    def error_name(self, code: int, joint: int = 0) -> str:
        return ERRORS.get(code, f"error bit {code - 1}")


def _pairs(numbers: np.ndarray) -> np.ndarray:
    """Whole numbers (k,) as two bytes each, (k, 2)."""
    return numbers.astype(_SHORTS).view(np.uint8).reshape(-1, 2)


def _within(time_s: np.ndarray, longest_s: np.ndarray) -> np.ndarray:
    """Which times (n,), as floats of four bytes carry them, are above 0 and no longer than these."""
    return (time_s > 0.0) & (time_s <= longest_s * (1.0 + 1e-6))


def _words(n: int, first: int, second: int) -> np.ndarray:
    """Two words, the same in n frames, (n, 8)."""
    return np.tile(np.array([first, second], _WORDS).view(np.uint8), (n, 1))
