"""Simulated motors: receive requests, follow the joint law, and reply with quantised readings."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from footfall.common.arrays import any_nonzero
from footfall.deploy.config import MOTOR_TIMEOUT_S
from footfall.deploy.drivers.driver import Motors
from footfall.deploy.frames import Frames
from footfall.domain_rand.sample import Sample, randomised_command, sensor_bias
from footfall.plant.delays import Delay
from footfall.plant.drivetrain import Drivetrain
from footfall.plant.motor_ends.motor_end import DEFAULT_SUPPLY, MotorEnd, Report, Request, Requests
from footfall.plant.watchdog import Watchdog
from footfall.robots.actuator import JointCommand, Motor
from footfall.robots.actuator_net import ActuatorNet
from footfall.robots.winding import Winding

TEMPERATURE_C = 30
HOTTEST_REPORTED_C = 127  # limit of a signed byte, which some frames carry


@dataclass
class MotorFaults:
    """Faults to inject, switched on and off from outside. Arrays are (n,) in joint order."""

    silent: np.ndarray  # bool: disconnected from the bus; the motor runs until its own timeout
    stuck: np.ndarray  # bool: repeats its last report
    error: np.ndarray  # uint64: reported error code
    latched: np.ndarray  # uint64: reported error code; the motor stays disabled until its errors are cleared


class SimulatedMotors:
    """All motors of a robot. Time is counted in physics steps."""

    def __init__(
        self,
        end: MotorEnd,
        motor: Motor,
        joints: int,
        sample: Sample,
        step_s: float,
        timeout_s: float | np.ndarray = MOTOR_TIMEOUT_S,
        winding: Winding | None = None,
        seed: int = 0,
        net: ActuatorNet | None = None,
    ) -> None:
        """Motors start disabled.

        Args:
            end: the motors' end of their protocol.
            motor: their limits and losses.
            joints: number of motors.
            sample: their differences from nominal motors.
            step_s: the physics step.
            timeout_s: time without a frame after which a motor disables itself, unless a frame sets another;
                for all motors, or for each, (joints,).
            winding: their thermal parameters; None for motors that stay at 30 degrees Celsius.
            seed: seed of the delay's jitter.
            net: the learned part of their joint law.
        """
        n = joints
        self._end = end
        self.broadcasts = end.broadcasts
        self.drivetrain = Drivetrain(motor, n, sample, step_s, winding, net)
        self.encoder_bias = np.zeros(n)
        bias = sensor_bias(sample, "joint_position")
        if bias is not None:
            self.encoder_bias += bias
        scale = np.stack(randomised_command(JointCommand(*np.ones((5, n))), sample))
        self._gain_scale = None if (scale == 1.0).all() else scale
        self._delay = Delay(sample, "actions", step_s, seed)
        self._watchdog = Watchdog(end, timeout_s, step_s, n)
        self._geared: tuple[np.ndarray, np.ndarray] | None = None  # see `regear`
        self.faults = MotorFaults(*np.zeros((2, n), bool), *np.zeros((2, n), np.uint64))
        self.enabled = np.zeros(n, dtype=bool)
        self._any_enabled = self._all_enabled = False
        self.supply = DEFAULT_SUPPLY  # V, and A of each motor, as they report it
        self.commanded = False  # whether a command with gains or torque has reached enabled motors
        self._values = np.zeros((5, n))  # the command that each motor follows
        self._command = JointCommand(*self._values)  # its rows
        self._due: deque[tuple[int, Motors, np.ndarray]] = deque()
        self._reported = Report(np.zeros((3, n)), np.zeros(n, np.uint64), np.zeros(n, bool))

    def torque(self, step: int, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Motor torque at the joint in this physics step, N m, (n,), before gearbox friction.

        Args:
            step: the step's number.
            position: true joint positions, rad; a motor controls its encoder's position, bias included.
            velocity: true joint velocities, rad/s.
        """
        while self._due and self._due[0][0] <= step:
            _, motors, values = self._due.popleft()
            self._values[:, motors] = values
            self.commanded = self.commanded or (self._any_enabled and bool(values[2:].any()))
        timed_out = self._watchdog.check(step, self.enabled) if self._any_enabled else None
        if timed_out is not None:
            self.enabled &= ~timed_out
            self._note_enabled()
        if not self._any_enabled:
            return self.drivetrain.delivered(np.zeros(len(position)))
        ratio = None
        if self._geared is not None:
            ratio, about = self._geared
            position, velocity = about + ratio * (position - about), ratio * velocity
        torque = self.drivetrain.demand(self._command, position + self.encoder_bias, velocity)
        if ratio is not None:
            torque = ratio * torque
        return self.drivetrain.delivered(torque if self._all_enabled else self.enabled * torque)

    def reboot(self, motors: np.ndarray) -> None:
        """Disable motors (joint indices), as after power-up."""
        self.enabled[motors] = False
        self._note_enabled()

    def weaken(self, strength: np.ndarray) -> None:
        """Scale the delivered torque of each motor from now on, (n,)."""
        self.drivetrain.weaken(strength)

    def sag(self, share: float) -> None:
        """Scale the supply voltage by `share` from now on."""
        self.drivetrain.sag(share)

    def rewire(self, end: MotorEnd) -> None:
        """Replace the motors' end of the wires: from now on other frames reach each motor."""
        self._end = end

    def regear(self, ratio: np.ndarray, about: np.ndarray) -> None:
        """Give motors other gear ratios than their firmware assumes: reports and commands are then wrong.

        Args:
            ratio: (n,) turns of the real gear over those of the assumed one; negative for a motor that is
                reversed.
            about: (n,) joint positions at which the encoders are still right, rad.
        """
        self._geared = ratio, about

    def at_joint(self, position: np.ndarray, velocity: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Torque at the joint behind gearboxes that transmit a torque (n,), N m, (n,).

        The learned part of the joint law acts there; its memory advances by a physics step.

        Args:
            position: true joint positions, rad.
            velocity: true joint velocities, rad/s.
            torque: torque of the motors, as `torque` returns it.
        """
        return self.drivetrain.behind_gearbox(
            self._command, self.enabled, position, self.encoder_bias, velocity, torque
        )

    def answer(self, step: int, frames: Frames, readings: np.ndarray) -> Frames | None:
        """Process frames; returns the replies of the addressed motors.

        Args:
            step: the current physics step.
            frames: the arrived frames.
            readings: (3, n) position, velocity and torque that every motor would report now.
        """
        requests = self._end.requests(frames)
        if any_nonzero(self.faults.silent):
            requests = requests.take(~self.faults.silent[requests.motor], len(self.enabled))
        motor, values, kind = requests
        if not values.shape[1]:
            answers = self._end.settings_replies(frames)
            self._watchdog.read_timeouts()
            return answers
        if self._gain_scale is not None:
            values = values * self._gain_scale[:, motor]
        if kind is None:
            self._queue(step, motor, values)
            self._watchdog.address(motor, step)
        else:
            self._follow_each(step, requests._replace(values=values), readings)
            self._watchdog.read_timeouts()
            self._watchdog.address(requests.take(kind != Request.READ, len(self.enabled)).motor, step)
        return self._reply(motor, readings)

    def _follow_each(self, step: int, requests: Requests, readings: np.ndarray) -> None:
        """Process requests one by one, if not all of them are commands."""
        assert requests.kind is not None
        motors = np.arange(len(self.enabled))[requests.motor]
        for row, (motor, kind) in enumerate(zip(motors.tolist(), requests.kind.tolist(), strict=True)):
            if kind == Request.ENABLE:
                if self._locked()[motor]:
                    continue
                if not self.enabled[motor]:
                    self._values[:, motor] = 0.0  # a motor starts without torque
                self.enabled[motor] = True
                self._watchdog.timed_out[motor] = False
            elif kind == Request.CLEAR:
                self._clear(motor)
            elif kind == Request.DISABLE:
                self.enabled[motor] = False
            elif kind == Request.STOP:
                self.enabled[motor] = False
                self._clear(motor)
            elif kind == Request.ZERO:
                self.encoder_bias[motor] -= readings[0, motor]
            elif kind != Request.READ and (kind == Request.COMMAND or not self._locked()[motor]):
                self.enabled[motor] |= kind == Request.RUN
                values = requests.values[:, row : row + 1]
                self._queue(step, np.array([motor]), values)
        self._note_enabled()

    def _queue(self, step: int, motor: Motors, values: np.ndarray) -> None:
        """Queue commands for the time after the delay; older commands take effect no later than these."""
        at = step + self._delay.steps(step)
        if self._delay.varies:
            self._due = deque(
                (min(due, at), queued_motors, queued_values)
                for due, queued_motors, queued_values in self._due
            )
        self._due.append((at, motor, values))

    def _clear(self, motor: int) -> None:
        self._watchdog.timed_out[motor], self.faults.latched[motor] = False, 0

    def _locked(self) -> np.ndarray:
        """Which motors cannot be enabled until their errors are cleared."""
        return (self.faults.latched != 0) | (self._watchdog.timed_out & self._end.timeout_latches)

    def _note_enabled(self) -> None:
        self._any_enabled, self._all_enabled = bool(self.enabled.any()), bool(self.enabled.all())

    def _reply(self, motor: Motors, readings: np.ndarray) -> Frames | None:
        frames = self._end.reply(motor, self._report(readings).take(motor))
        return frames if len(frames.id) else None

    def broadcast(self, now_us: int, readings: np.ndarray) -> Frames | None:
        """The frames that motors send now without a request; `readings` as for `answer`."""
        return self._end.broadcast(now_us, ~self.faults.silent, self._report(readings))

    def _reported_c(self) -> int | np.ndarray:
        """Temperature that motors report, whole degrees Celsius: of all, or (n,)."""
        winding_c = self.drivetrain.winding_c
        if winding_c is None:
            return TEMPERATURE_C
        return np.rint(winding_c).clip(0, HOTTEST_REPORTED_C).astype(int)

    def _report(self, readings: np.ndarray) -> Report:
        """The current report of every motor; a stuck one repeats its last report."""
        if self._geared is not None:
            ratio, about = self._geared
            centre = about + self.encoder_bias
            readings = np.array(
                [centre + ratio * (readings[0] - centre), ratio * readings[1], readings[2] / ratio]
            )
        error, on = np.maximum(self.faults.error, self.faults.latched), self.enabled.copy()
        timed_out = self._watchdog.timed_out
        if any_nonzero(timed_out):
            error = np.maximum(error, timed_out * np.asarray(self._end.timeout_error, np.uint64))
        report, stuck = Report(readings, error, on, self._reported_c(), self.supply), self.faults.stuck
        if any_nonzero(stuck):
            before = self._reported
            report = report._replace(
                values=np.where(stuck, before.values, report.values),
                error=np.where(stuck, before.error, report.error),
                on=np.where(stuck, before.on, report.on),
            )
        self._reported = report
        return report
