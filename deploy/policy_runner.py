"""Runs a policy at its own rate: what it is given, what it decides, and how long that takes."""

import math
import os
import time

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.command_source import Pose, Status
from footfall.deploy.deadline import Arm, OverdueError, unarmed
from footfall.deploy.modes import DECIDING
from footfall.deploy.safety import State
from footfall.deploy.signals import PolicySignals
from footfall.deploy.steering import Steering
from footfall.deploy.timing import Durations
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.actuator import JointCommand

FAILURES = (Exception, SystemExit)  # a policy that calls sys.exit() has failed; Ctrl-C ends the program
FORKED = 1  # exit status of a copy of the process that comes back from a policy's step


class PolicyRunner:
    """A policy, what it is asked for, and its last decision."""

    def __init__(
        self,
        policy: Policy,
        steering: Steering,
        joint_rate_hz: float,
        limit_s: float,
        realtime: bool,
        arm: Arm = unarmed,
    ) -> None:
        """A policy that has not begun.

        Args:
            policy: decides.
            steering: says what it shall do.
            joint_rate_hz: of the loop.
            limit_s: how long one step may take.
            realtime: whether steps are timed. Simulated time waits for them.
            arm: sets a deadline for a step.

        Raises:
            UserError: the policy is faster than the loop.
        """
        if not 0.0 < policy.rate_hz <= joint_rate_hz:
            raise UserError(
                f"policy '{policy.name}' runs at {policy.rate_hz:g} Hz,"
                f" the joint loop at {joint_rate_hz:g} Hz: the policy cannot be faster"
            )
        self._policy, self.steering = policy, steering
        self._limit_s, self._realtime, self._arm = limit_s, realtime, arm
        self._period_us = 1e6 / policy.rate_hz
        self._process = os.getpid()
        self._began_us = 0
        self._next_us = 0.0  # half a microsecond early, so that rounding cannot cost a tick
        self.signals = PolicySignals()
        self.decision: np.ndarray | None = None  # rows as of `JointCommand`
        self.durations_ms = Durations()
        self._noted = self._told = 0  # notes of the policy that are taken over, of the run that are told

    @property
    def notes(self) -> list[str]:
        """What was changed of what was asked for, one line each."""
        of_policy, notes = self._policy.notes, self.steering.notes
        if len(of_policy) > self._noted:
            notes.extend(of_policy[self._noted :])
            self._noted = len(of_policy)
        return notes

    def new_notes(self) -> list[str]:
        """Notes that were not returned before."""
        new = self.notes[self._told :]
        self._told += len(new)
        return new

    def status(self, now_us: int, state: State, estimate: tuple[np.ndarray, float], pose: Pose) -> Status:
        """The run as it is now, for the command source.

        Args:
            now_us: the loop's time.
            state: the supervisor's.
            estimate: the base's velocity (3,) m/s, body frame, and height m.
            pose: of the base.
        """
        walking_s = self.time_s(now_us) if state.mode in DECIDING else 0.0
        steering = self.steering
        return Status(
            now_us * 1e-6,
            walking_s,
            state.mode,
            self._policy.name,
            steering.command,
            *estimate,
            pose,
            state.faults,
            self.notes,
            steering.offer,
        )

    def start(self, now_us: int) -> None:
        """The policy takes over now."""
        self._began_us, self._next_us = now_us, now_us - 0.5

    def time_s(self, now_us: int) -> float:
        """Time since the policy took over, s."""
        return (now_us - self._began_us) * 1e-6

    def due(self, now_us: int) -> bool:
        """Whether it is time for a step."""
        return now_us >= self._next_us

    def stance(self) -> np.ndarray | None:
        """The policy's contact plan; None before its first step, or if it fails, which `signals` tell."""
        if self.decision is None:  # before its reset a policy's plan is of another episode
            return None
        try:
            return self._policy.stance()
        except FAILURES as error:
            self._failed(error)
            return None

    def footholds(self) -> np.ndarray | None:
        """Planned footholds (see `PlansFootholds`); None if the policy plans none."""
        if self.decision is None or not hasattr(self._policy, "footholds"):
            return None
        try:
            return self._policy.footholds()
        except FAILURES as error:
            self._failed(error)
            return None

    def poll(self, now_us: int, status: Status) -> None:
        """Ask the command source while the policy does not decide; `signals` tell if it fails."""
        try:
            self.steering.poll(now_us, status, follow=False)
        except FAILURES as error:
            self._failed(error)

    def step(
        self, now_us: int, status: Status, sensed: Sensed, estimate: tuple[np.ndarray, float], walking: bool
    ) -> tuple[PolicyInput, np.ndarray] | None:
        """One step; returns what the policy was given and its decision, or None if it failed or hung.

        Args:
            now_us: the loop's time.
            status: for the command source.
            sensed: the latest readings.
            estimate: the base's velocity (3,) m/s, body frame, and height m.
            walking: whether the commands come from the source; otherwise they are zero.
        """
        started = time.perf_counter()
        try:
            try:
                self._arm(self._limit_s)
                given, decision = self._decide(now_us, status, sensed, estimate, walking)
            finally:
                self._arm(0.0)
                if os.getpid() != self._process:  # a policy that forked: its copy holds no robot
                    os._exit(FORKED)
        except OverdueError:
            self.signals = self.signals._replace(step_s=math.inf)
            return None
        except FAILURES as error:
            self._failed(error)
            return None
        finite = math.isfinite(np.add.reduce(decision, axis=None))
        took_s = time.perf_counter() - started
        self.decision = decision
        self.durations_ms.add(took_s * 1e3)
        if self._realtime:
            late = self.signals.late_steps + 1 if took_s * 1e6 > self._period_us else 0
            self.signals = self.signals._replace(command_finite=finite, late_steps=late, step_s=took_s)
        elif finite is not self.signals.command_finite:
            self.signals = self.signals._replace(command_finite=finite)
        periods = math.ceil((now_us - self._next_us) / self._period_us)
        self._next_us += self._period_us * max(1, periods)
        return given, decision

    def _decide(
        self, now_us: int, status: Status, sensed: Sensed, estimate: tuple[np.ndarray, float], walking: bool
    ) -> tuple[PolicyInput, np.ndarray]:
        self.steering.poll(now_us, status, walking)
        given = PolicyInput(self.time_s(now_us), sensed, self.steering.command, *estimate)
        if self.decision is None:
            self._policy.reset(given)
        return given, _copied(self._policy.act(given), len(sensed.joint_position))

    def _failed(self, error: BaseException) -> None:
        self.signals = self.signals._replace(error=f"the policy failed: {type(error).__name__}: {error}")


def _copied(command: JointCommand, joints: int) -> np.ndarray:
    """A copy of a policy's command, (5, n).

    Raises ValueError for another shape, masked entries, or complex numbers.
    """
    if any(_unreal(row) for row in command):
        raise ValueError("it decides on masked or complex numbers, expected real ones")
    values = np.array(command, dtype=float)
    if values.shape != (5, joints):
        raise ValueError(f"it decides on shape {values.shape}, expected (5, {joints})")
    return values


def _unreal(row: np.ndarray) -> bool:
    return np.iscomplexobj(row) or (isinstance(row, np.ma.MaskedArray) and np.ma.is_masked(row))
