"""ODrive axes: they follow torques and broadcast their measurements."""

import numpy as np

from footfall.deploy.drivers import odrive
from footfall.deploy.drivers.driver import CanFilter, Motors
from footfall.deploy.frames import Frames, joined, no_frames
from footfall.deploy.wiring import Wiring
from footfall.plant.motor_ends.motor_end import Report, Request, Requests

READING_US = 2000  # encoder_msg_rate_ms and torques_msg_rate_ms
SLOW_US = 100_000  # heartbeat, temperature and supply
DELIVERED_CURRENT_A = 10.0  # current_soft_max
STAGGER_US = 7000  # between axes, so that their slow messages do not coincide

# Slow messages of an axis: each is sent a third of `SLOW_US` after the previous one.
_SLOW = (
    odrive.HEARTBEAT,
    odrive.TEMPERATURE,
    odrive.SUPPLY,
)
_KIND = {
    odrive.TORQUE: Request.COMMAND,
    odrive.VELOCITY: Request.COMMAND,
    odrive.CLEAR: Request.CLEAR,
    odrive.POSITION: Request.ZERO,
    odrive.MODE: None,  # takes effect at once
    odrive.GAINS: None,  # takes effect at once
    odrive.STATE: None,  # enables or disables
}


class OdriveMotorEnd:
    """Simulated ODrive axes: they decode requests and broadcast readings.

    `mode` (n, 2) has the control and input modes of each axis, `damping` (n,) its velocity gain at the joint,
    N m s/rad, `watchdog` (2, n) whether its watchdog is on and its time in s, `current_limit` (n,) is in A.
    """

    filters: tuple[CanFilter, ...] = tuple(
        {"can_id": message, "can_mask": 0x1F, "extended": False} for message in (*_KIND, odrive.READ)
    )
    timeout_error = odrive.WATCHDOG
    timeout_latches = True
    broadcasts = True

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor id that is not a node id."""
        n = len(wiring.motor_id)
        self.timeout_s = np.full(n, np.nan)
        self._wiring, self._lookup = wiring, odrive.node_lookup(wiring)
        self._gear = wiring.gear_ratio
        self._per_turn = odrive.TURN / wiring.gear_ratio
        self.mode = np.zeros((n, 2), np.intp)
        self.damping = np.zeros(n)
        self.watchdog = np.tile([[1.0], [0.1]], n)
        self.current_limit = np.full(n, DELIVERED_CURRENT_A)
        self._stagger_us = STAGGER_US * np.arange(n)
        self._eights = np.full(n, 8)
        self._ids = {
            message: wiring.motor_id << 5 | message for message in (odrive.ENCODER, odrive.TORQUES, *_SLOW)
        }

    def requests(self, frames: Frames) -> Requests:
        message = frames.id & 0x1F
        motor = self._lookup[frames.channel, np.where(frames.id < 0x800, frames.id >> 5, 0)]
        usable = (motor >= 0) & np.isin(message, list(_KIND))
        message, motor, frames = message[usable], motor[usable], frames.take(usable)
        words = np.stack([odrive.word_of(frames.data), odrive.word_of(frames.data[:, 4:])], axis=1).astype(
            np.intp
        )
        first, second = odrive.floats(frames.data)
        sets_mode, sets_gain = message == odrive.MODE, message == odrive.GAINS
        self.mode[motor[sets_mode]] = words[sets_mode]
        axes = motor[sets_gain]
        self.damping[axes] = first[sets_gain] * self._gear[axes] / self._per_turn[axes]
        accepted = ~(sets_mode | sets_gain) & np.isfinite(first) & np.isfinite(second)
        accepted &= (message != odrive.TORQUE) | (self.mode[motor] == odrive.TORQUE_CONTROL).all(axis=1)
        motor, message, first, second = motor[accepted], message[accepted], first[accepted], second[accepted]
        values = np.zeros((5, len(motor)))
        by_torque, by_velocity = message == odrive.TORQUE, message == odrive.VELOCITY
        values[4] = np.select([by_torque, by_velocity], [first, second]) * self._gear[motor]
        if by_torque.all():
            return Requests(motor, values, None)
        velocity_controlled = by_velocity & (self.mode[motor] == odrive.VELOCITY_CONTROL).all(axis=1)
        values[1] = velocity_controlled * first * self._per_turn[motor]
        values[3] = velocity_controlled * self.damping[motor]
        state = np.where(words[accepted, 0] == odrive.CLOSED_LOOP, Request.ENABLE, Request.DISABLE)
        kinds = [
            int(switched) if (kind := _KIND[each]) is None else int(kind)
            for each, switched in zip(message.tolist(), state.tolist(), strict=True)
        ]
        return Requests(motor, values, np.array(kinds))

    def settings_replies(self, frames: Frames) -> Frames | None:
        motor = self._lookup[frames.channel, np.where(frames.id < 0x800, frames.id >> 5, 0)]
        rows = np.flatnonzero((motor >= 0) & (frames.id & 0x1F == odrive.READ) & (frames.length >= 4))
        endpoint = odrive.endpoint_of(frames.data[rows])
        limits = np.flatnonzero(endpoint == self._wiring.current_endpoint[motor[rows]])
        for row in rows[limits[frames.data[rows[limits], 0] == 1]].tolist():
            self.current_limit[motor[row]] = odrive.floats(frames.data[[row]])[1, 0]
        rows, endpoint = rows[frames.data[rows, 0] == 0], endpoint[frames.data[rows, 0] == 0]
        endpoints = self._wiring.watchdog_endpoints, self._wiring.current_endpoint[:, None]
        addressed = endpoint[:, None] == np.hstack(endpoints)[motor[rows]]
        rows, column = rows[addressed.any(axis=1)], addressed.argmax(axis=1)[addressed.any(axis=1)]
        if not rows.size:
            return None
        data, axes = frames.data[rows].copy(), motor[rows]
        data[:, 4:] = odrive.float_bytes(self.watchdog[1, axes])[:, :4]
        data[column == 0, 4:] = 0
        data[column == 0, 4] = self.watchdog[0, axes[column == 0]]
        data[column == 2, 4:] = odrive.float_bytes(self.current_limit[axes[column == 2]])[:, :4]
        identifier = self._wiring.motor_id[axes] << 5 | odrive.READ_REPLY
        return Frames(self._wiring.channel[axes], identifier, data, np.where(column == 0, 5, 8))

    def reply(self, motor: Motors, report: Report) -> Frames:
        """No frames: only reads are answered."""
        return no_frames()

    def broadcast(self, now_us: int, connected: np.ndarray, report: Report) -> Frames | None:
        """Frames of this millisecond: readings of one half of the axes, and slow messages that are due."""
        n = len(connected)
        position, velocity, torque = report.values
        estimates = position / self._per_turn, velocity / self._per_turn
        at_rotor = torque / self._gear
        due_axes = np.flatnonzero(connected & ((now_us + 1000 * np.arange(n)) % READING_US == 0))
        batches = [
            self._frames(odrive.ENCODER, due_axes, odrive.float_bytes(*estimates)),
            self._frames(odrive.TORQUES, due_axes, odrive.float_bytes(at_rotor, at_rotor)),
        ]
        for index, message in enumerate(_SLOW):
            phase_us = (now_us - self._stagger_us - index * 33_000) % SLOW_US
            if (due := np.flatnonzero(connected & (phase_us < 1000))).size:
                batches.append(self._frames(message, due, self._slow(message, report)))
        return joined(batches)

    def _frames(self, message: int, motor: np.ndarray, data: np.ndarray) -> Frames:
        return Frames(
            self._wiring.channel[motor], self._ids[message][motor], data[motor], self._eights[motor]
        )

    def _slow(self, message: int, report: Report) -> np.ndarray:
        n, error = len(report.error), report.error
        if message == odrive.TEMPERATURE:
            temperature = np.full(n, report.temperature_c)
            return odrive.float_bytes(temperature, temperature)
        if message == odrive.SUPPLY:
            voltage_v, current_a = report.supply
            return odrive.float_bytes(np.full(n, voltage_v), current_a)
        bits = np.where(error > 0, 1 << (np.maximum(error, 1).astype(np.int64) - 1), 0)
        data = np.zeros((n, 8), np.uint8)
        data[:, :4] = bits.astype("<u4").view(np.uint8).reshape(n, 4)
        data[:, 4] = np.where(report.on, odrive.CLOSED_LOOP, odrive.IDLE)
        data[:, 6] = 1
        return data
