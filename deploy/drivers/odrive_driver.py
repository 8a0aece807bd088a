"""ODrive axes: joint law on the host, and broadcast measurements."""

import math

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.drivers import odrive
from footfall.deploy.drivers.driver import CanFilter, Replies
from footfall.deploy.drivers.odrive_watchdogs import Watchdogs
from footfall.deploy.drivers.settings import Limit, Settings
from footfall.deploy.frames import Frames, frame_bits, joined
from footfall.deploy.wiring import Wiring

# Age of a reading, in commands, from which on no torque is sent: a torque computed from a reading is right
# only for a short time.
MAX_READING_AGE = 5
MAX_WITHOUT_TORQUE = 25  # largest number of consecutive readings of the position without one of the torque
ENABLE_EVERY = 100  # ticks; longer than a heartbeat takes to confirm enable
CURRENT_LIMIT = 0  # number of the current limit in `Settings`, which has no other setting here


class _Axes:
    """Latest broadcast values of n axes."""

    def __init__(self, n: int) -> None:
        self.values = np.zeros((3, n))  # position rad, velocity rad/s, torque N m, at the joint
        self.age = np.full(n, MAX_READING_AGE)  # commands since the last position
        self.without_torque = np.full(n, MAX_WITHOUT_TORQUE)  # positions since the last torque
        self.state = np.zeros(n, np.uint8)  # 0 before the first heartbeat
        self.was_on = np.zeros(n, bool)
        self.error = np.zeros(n, np.intp)
        self.temperature, self.voltage, self.current = np.full((3, n), np.nan)


class OdriveDriver:
    """ODrive driver. It computes the joint law itself, from the latest readings."""

    maker = "ODrive"
    models: tuple[str, ...] = (odrive.MODEL,)
    drive_limits: tuple[str, ...] = ("current",)
    motor_end = "footfall.plant.motor_ends.odrive:OdriveMotorEnd"
    filters: tuple[CanFilter, ...] = tuple(
        {"can_id": message, "can_mask": 0x1F, "extended": False}
        for message in (
            odrive.HEARTBEAT,
            odrive.READ_REPLY,
            odrive.ENCODER,
            odrive.TEMPERATURE,
            odrive.SUPPLY,
            odrive.TORQUES,
        )
    )

    def __init__(self, wiring: Wiring) -> None:
        """Raises UserError for a motor id that is not a node id, or a current limit without its endpoint."""
        n = len(wiring.motor_id)
        self._wiring, self._lookup = wiring, odrive.node_lookup(wiring)
        self._watchdogs, limited = Watchdogs(wiring), np.isfinite(wiring.highest)
        if (limited & (wiring.current_endpoint == 0)).any():
            raise UserError("an ODrive with drive_limit needs current_endpoint, that of current_soft_max")
        limit = Limit(CURRENT_LIMIT, "current_soft_max (A)", wiring.highest)
        self._limits = Settings(wiring, {}, None, limit=limit)
        self._gear = wiring.gear_ratio
        self._per_turn = odrive.TURN / wiring.gear_ratio  # rad at the joint
        self.highest = np.full((5, n), np.inf)  # a float has no limit below the motor's
        self.lowest = -self.highest
        self.lowest[2:4] = 0.0
        self.gain_rounding = np.zeros((2, n))  # gains stay on the host
        self.exchange_bits = np.full(n, frame_bits(4) + 2 * frame_bits(8))
        self._axes = _Axes(n)
        self._enable_ticks = 0  # calls of `enable` since the last `disable`
        self._torque = self._frames(odrive.TORQUE, 4, np.zeros((n, 8), np.uint8))
        self._mode = self._frames(odrive.MODE, 8, odrive.word_bytes(n, *odrive.TORQUE_CONTROL))

    def _frames(self, message: int, length: int, data: np.ndarray) -> Frames:
        identifier = self._wiring.motor_id << 5 | message
        return Frames(self._wiring.channel, identifier, data, np.full(len(identifier), length))

    @staticmethod
    def identifiers(motor_id: int) -> tuple[int, ...]:
        return tuple(range(motor_id << 5, (motor_id + 1) << 5))

    @staticmethod
    def probes(motor_id: int) -> tuple[tuple[int, bytes], ...]:
        """Empty: an axis broadcasts its heartbeat."""
        return ()

    @staticmethod
    def senders(frames: Frames) -> np.ndarray:
        node = frames.id >> 5
        heartbeat = (frames.id & 0x1F == odrive.HEARTBEAT) & (frames.length == 8)
        return np.where(heartbeat & (node >= odrive.NODES[0]) & (node <= odrive.NODES[-1]), node, -1)

    def query_settings(self) -> Frames:
        """Set torque control, and read one value of each axis: of its watchdog, then of its current limit."""
        axes, endpoints = self._watchdogs.due_reads()
        limit_reads = [] if axes.size else self._limits.due_reads()  # the interface's queue is short
        limited = np.array([each.motor for each in limit_reads], np.intp)
        writes = np.array([each.motor for each in limit_reads if each.write is not None], np.intp)
        endpoint = self._wiring.current_endpoint
        return joined(
            [
                self._mode,
                self._access(writes, odrive.writes(endpoint[writes], self._wiring.highest[writes]), 8),
                self._access(axes, odrive.reads(endpoints), 4),
                self._access(limited, odrive.reads(endpoint[limited]), 4),
            ]
        )

    def _access(self, axes: np.ndarray, data: np.ndarray, length: int) -> Frames:
        """Frames that read or write endpoints of axes (k,)."""
        identifier = self._wiring.motor_id[axes] << 5 | odrive.READ
        return Frames(self._wiring.channel[axes], identifier, data, np.full(len(axes), length))

    def not_ready(self) -> str:
        axes = self._axes
        for missing, what in (
            (axes.age >= MAX_READING_AGE, "sends no position (set encoder_msg_rate_ms to a joint tick)"),
            (axes.without_torque >= MAX_WITHOUT_TORQUE, "sends no torque (set torques_msg_rate_ms)"),
            (axes.state == 0, "sends no heartbeat (set heartbeat_msg_rate_ms)"),
        ):
            if missing.any():
                return f"motor {self._wiring.label(int(missing.argmax()))} {what}"
        return self._watchdogs.problem() or self._limits.problem()

    def enable(self) -> Frames:
        """Frames that enable, but only at intervals: an enabled axis restarts when it is enabled again."""
        due = self._enable_ticks % ENABLE_EVERY == 0
        self._enable_ticks += 1
        if not due:
            return self._mode
        return self._frames(odrive.STATE, 4, odrive.word_bytes(len(self._gear), odrive.CLOSED_LOOP))

    def not_enabled(self) -> str:
        off = self._axes.state != odrive.CLOSED_LOOP
        return (
            f"motor {self._wiring.label(int(off.argmax()))} does not confirm that it is enabled"
            if off.any()
            else ""
        )

    def disable(self) -> Frames:
        self._axes.was_on[:], self._enable_ticks = False, 0
        return self._frames(odrive.STATE, 4, odrive.word_bytes(len(self._gear), odrive.IDLE))

    def not_confirmed_off(self) -> np.ndarray:
        """Mask (n,) by the heartbeats: an axis sends its readings both enabled and disabled."""
        state = self._axes.state
        return np.asarray((state == 0) | (state == odrive.CLOSED_LOOP))

    def clear(self) -> Frames:
        return self._frames(odrive.CLEAR, 0, np.zeros((len(self._gear), 8), np.uint8))

    def zero(self) -> Frames:
        return self._frames(odrive.POSITION, 4, np.zeros((len(self._gear), 8), np.uint8))

    def command(self, values: np.ndarray) -> Frames:
        """Torque of the PD law (`robots/actuator.py`) for the latest reading; 0 if that is too old."""
        position, velocity, _ = self._axes.values
        torque = values[2] * (values[0] - position) + values[3] * (values[1] - velocity) + values[4]
        if not math.isfinite(np.add.reduce(values, axis=None)) or not np.isfinite(torque).all():
            raise ValueError("a command that is not finite cannot be sent")
        torque[self._axes.age >= MAX_READING_AGE] = 0.0
        self._axes.age += 1
        return self._torque._replace(data=odrive.float_bytes(torque / self._gear))

    def damping(self, kd: np.ndarray) -> tuple[Frames, ...]:
        """Velocity control with the target 0: the axis itself computes this damping, without the host.

        The first batch removes the last torque. `query_settings` and `enable` return to torque control.
        """
        n = len(self._gear)
        gain = kd * odrive.TURN / self._gear**2
        return (
            self._frames(odrive.VELOCITY, 8, np.zeros((n, 8), np.uint8)),
            self._frames(odrive.GAINS, 8, odrive.float_bytes(gain)),
            self._frames(odrive.MODE, 8, odrive.word_bytes(n, *odrive.VELOCITY_CONTROL)),
        )

    def replies(self, frames: Frames) -> Replies:
        """A reply is an axis' position and velocity, with the latest values of its other messages."""
        axes, message = self._axes, frames.id & 0x1F
        node = np.where(frames.id < 0x800, frames.id >> 5, 0)
        motor = self._lookup[frames.channel, node]
        usable = (motor >= 0) & ((frames.length == 8) | (message == odrive.READ_REPLY) & (frames.length > 4))
        if not usable.all():
            frames, motor, message = frames.take(usable), motor[usable], message[usable]
        first, second = odrive.floats(frames.data)
        encoder = (message == odrive.ENCODER) & np.isfinite(first) & np.isfinite(second)
        if not encoder.all():
            self._note(message[~encoder], motor[~encoder], frames.data[~encoder])
        motor = motor[encoder]
        axes.values[:2, motor] = first[encoder], second[encoder]
        axes.values[:2, motor] *= self._per_turn[motor]
        axes.age[motor] = 0
        axes.without_torque[motor] += 1
        error = axes.error[motor]
        error[(error == 0) & (axes.without_torque[motor] > MAX_WITHOUT_TORQUE)] = odrive.NO_TORQUES
        return Replies(
            motor,
            axes.values[:, motor],
            error.astype(np.uint8),
            axes.temperature[motor],
            axes.voltage[motor],
            None if frames.time_us is None else frames.time_us[encoder],
            axes.current[motor],
        )

    def _note(self, message: np.ndarray, motor: np.ndarray, data: np.ndarray) -> None:
        """Store the content of k frames that are not positions."""
        axes = self._axes
        for kind in set(message.tolist()):
            rows = message == kind
            axis, content = motor[rows], data[rows]
            first, second = odrive.floats(content)
            finite = np.isfinite(first) & np.isfinite(second)
            finite_axis = axis[finite]
            if kind == odrive.HEARTBEAT:
                self._note_heartbeats(axis, content)
            elif kind == odrive.READ_REPLY:
                self._watchdogs.note(axis, content)
                limited = odrive.endpoint_of(content) == self._wiring.current_endpoint[axis]
                for joint, value in zip(axis[limited].tolist(), second[limited].tolist(), strict=True):
                    self._limits.note(joint, CURRENT_LIMIT, value)
            elif kind == odrive.TORQUES:
                axes.values[2, finite_axis] = second[finite] * self._gear[finite_axis]
                axes.without_torque[finite_axis] = 0
            elif kind == odrive.TEMPERATURE:
                axes.temperature[finite_axis] = np.maximum(first, second)[finite]
            elif kind == odrive.SUPPLY:
                axes.voltage[finite_axis], axes.current[finite_axis] = first[finite], second[finite]

    def _note_heartbeats(self, motor: np.ndarray, data: np.ndarray) -> None:
        """Store heartbeats (k, 8). An axis that was enabled and reports disabled has a fault."""
        axes, state = self._axes, data[:, 4]
        on = state == odrive.CLOSED_LOOP
        axes.state[motor] = state
        error = odrive.error_code(odrive.word_of(data))
        axes.error[motor] = np.where((error == 0) & ~on & axes.was_on[motor], odrive.NOT_ON, error)
        axes.was_on[motor] |= on & (self._enable_ticks > 0)

    def error_name(self, code: int, joint: int = 0) -> str:
        return odrive.ERRORS.get(code, f"error bit {code - 1}")
