"""Simulated MIT-mode motors: they decode frames, follow the joint law, and answer with quantised readings."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from footfall.deploy.config import MOTOR_TIMEOUT_S
from footfall.deploy.drivers import mit
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.domain_rand.sample import Sample, randomised_motor
from footfall.robots.actuator import JointCommand, Motor, friction_torque, motor_torque

TEMPERATURE_C = 30
_WATCHDOG_EVERY = 5  # steps

Motors = np.ndarray | slice  # which motors: indices, or all of them


@dataclass
class MotorFaults:
    """Faults to inject, switched on and off from outside. Arrays are (n,) in joint order."""

    silent: np.ndarray  # bool: cut off from the bus; the motor carries on until its own time-out
    stuck: np.ndarray  # bool: repeats its last reply
    error: np.ndarray  # uint8: error code that it reports


class SimulatedMotors:
    """All motors of a robot. Time is counted in physics steps."""

    def __init__(
        self, wiring: Wiring, motor: Motor, sample: Sample, step_s: float, timeout_s: float = MOTOR_TIMEOUT_S
    ) -> None:
        n = len(wiring.motor_id)
        self._wiring = wiring
        self._codec = mit.Codec(wiring.protocols)
        self._motor = randomised_motor(motor, sample)
        self.encoder_bias = np.zeros(n)
        if sample.encoder_bias is not None:
            self.encoder_bias += sample.encoder_bias
        self._gain_scale = np.ones((5, n))
        if sample.kp is not None:
            self._gain_scale[2] = sample.kp
        if sample.kd is not None:
            self._gain_scale[3] = sample.kd
        self._delay_steps = (
            0 if sample.action_delay_s is None else round(float(sample.action_delay_s) / step_s)
        )
        self._timeout_steps = round(timeout_s / step_s)
        self.faults = MotorFaults(np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, np.uint64))
        self.enabled = np.zeros(n, dtype=bool)
        self._any_enabled = False
        self._timed_out = np.zeros(n, dtype=bool)
        self._values = np.zeros((5, n))  # the command that each motor follows
        self._command = JointCommand(*self._values)  # its rows
        self._due: deque[tuple[int, Motors, np.ndarray]] = deque()
        self._heard_step = np.zeros(n, dtype=np.int64)
        self._head = wiring.motor_id.astype(np.uint64)
        self._reply = Frames(
            wiring.channel, mit.REPLY_ID + wiring.motor_id, np.zeros((n, 8), np.uint8), np.full(n, 8)
        )
        self._known: Frames | None = None  # the last batch that addressed every motor in joint order

    def torque(self, step: int, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Motor torque at the joint in this physics step, N m, (n,), before gearbox friction.

        Args:
            step: the step's number.
            position: true joint positions, rad; a motor closes its loop on its own encoder, bias and all.
            velocity: true joint velocities, rad/s.
        """
        while self._due and self._due[0][0] <= step:
            _, motors, values = self._due.popleft()
            self._values[:, motors] = values
        if step % _WATCHDOG_EVERY == 0 and self._any_enabled:
            self._watch(step)
        if not self._any_enabled:
            return np.zeros_like(position)
        return self.enabled * motor_torque(self._command, position + self.encoder_bias, velocity, self._motor)

    def friction(self, velocity: np.ndarray) -> np.ndarray:
        """Gearbox friction at the joint, N m, (n,)."""
        return friction_torque(velocity, self._motor)

    def obey(self, step: int, frames: Frames, readings: np.ndarray) -> Frames | None:
        """Take in frames; returns the replies of the motors that were addressed.

        Args:
            step: the present physics step.
            frames: what arrived.
            readings: (3, n) position, velocity and torque that every motor would report now.
        """
        motor, data = self._addressed(frames)
        if not len(data):
            return None
        word = mit.words(data)
        if word.max() < mit.ENTER:
            values = self._codec.decode(word, motor)
            self._due.append((step + self._delay_steps, motor, values * self._gain_scale[:, motor]))
        else:
            everyone = np.arange(len(self.enabled))[motor]
            for one, meaning in zip(everyone, word, strict=True):
                self._obey_one(step, int(one), int(meaning), readings)
        self._heard_step[motor] = step
        return self._answer(motor, readings)

    def _watch(self, step: int) -> None:
        """Switch off the motors that have not been spoken to for too long."""
        late = self.enabled & (step - self._heard_step > self._timeout_steps)
        if late.any():
            self._timed_out |= late
            self.enabled &= ~late
            self._any_enabled = bool(self.enabled.any())

    def _addressed(self, frames: Frames) -> tuple[Motors, np.ndarray]:
        """The motors that are spoken to, and the bytes that they get."""
        known = self._known
        if known is not None and frames.channel is known.channel and frames.id is known.id:
            motor, data = known.id, frames.data  # the usual batch, worked out before
            usable = None
        else:
            motor = self._wiring.lookup[frames.channel, frames.id & 0xFF]
            usable = (motor >= 0) & (frames.id < 0x100) & (frames.length == 8)
            motor, data = motor[usable], frames.data[usable]
            if len(motor) == len(self.enabled) and (np.diff(motor) == 1).all() and usable.all():
                self._known = frames
                usable = None
        if self.faults.silent.any():
            motor = np.arange(len(self.enabled)) if usable is None else motor
            hears = ~self.faults.silent[motor]
            return motor[hears], data[hears]
        return (slice(None) if usable is None else motor), data

    def _obey_one(self, step: int, motor: int, word: int, readings: np.ndarray) -> None:
        """One frame of a batch that holds special frames."""
        one = np.array([motor])
        if word == mit.ENTER:
            if not self.enabled[motor]:
                self._values[:, motor] = 0.0  # a motor wakes up limp
            self.enabled[motor] = self._any_enabled = True
            self._timed_out[motor] = False
        elif word == mit.EXIT:
            self.enabled[motor] = False
            self._any_enabled = bool(self.enabled.any())
        elif word == mit.ZERO:
            self.encoder_bias[motor] -= readings[0, motor]
        elif word < mit.ENTER:
            values = self._codec.decode(np.array([word], dtype=np.uint64), one)
            self._due.append((step + self._delay_steps, one, values * self._gain_scale[:, one]))

    def _answer(self, motor: Motors, readings: np.ndarray) -> Frames:
        error = np.maximum(self.faults.error, self._timed_out * np.uint64(mit.COMMUNICATION_LOST))
        tail = error[motor] | np.uint64(TEMPERATURE_C << 8)
        data = self._codec.encode_replies(motor, self._head[motor], readings[:, motor], tail)
        if self.faults.stuck.any():
            stuck = self.faults.stuck[motor]
            data[stuck] = self._reply.data[motor][stuck]
        if isinstance(motor, slice):
            self._reply = self._reply._replace(data=data)
            return self._reply
        kept = self._reply.data.copy()
        kept[motor] = data
        self._reply = self._reply._replace(data=kept)
        return self._reply.take(motor)
