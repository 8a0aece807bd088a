"""Runs a policy at its own rate: inputs, decisions and timing."""

import math
import os
import time
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.battery import BatteryState
from footfall.deploy.changes import Change
from footfall.deploy.command_source import ZERO_COMMAND, Pose, Status
from footfall.deploy.deadline import Arm, OverdueError, unarmed
from footfall.deploy.handover import Handover
from footfall.deploy.height_scan import HeightScans
from footfall.deploy.modes import DECIDING
from footfall.deploy.run_log import RunLog
from footfall.deploy.safety import State
from footfall.deploy.signals import PolicySignals
from footfall.deploy.steering import Run, Steering
from footfall.deploy.timing import Durations
from footfall.policies.live_settings import NOTHING_APPLIED, applied_of
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.actuator import JointCommand


class Notes(Protocol):
    """An object with notes: one line each, without repetition, in a list that only grows."""

    @property
    def notes(self) -> Sequence[str]: ...


class NoteSource:
    """Notes of one source, each returned once."""

    def __init__(self, source: Notes) -> None:
        self._source = source
        self._collected = 0

    def new(self) -> Sequence[str]:
        """Notes since the last call."""
        notes, start = self._source.notes, self._collected
        self._collected = len(notes)
        return notes[start:]


FAILURES = (Exception, SystemExit)  # a policy that calls sys.exit() has failed; Ctrl-C ends the program
FORK_EXIT_STATUS = 1  # exit status of a forked copy of the process that returns from a policy step


class PolicyRunner:
    """Policies of a run, requests to them, and the last decision."""

    def __init__(
        self,
        policies: Handover,
        steering: Steering,
        joint_rate_hz: float,
        limit_s: float,
        realtime: bool,
        arm: Arm = unarmed,
        height_scans: HeightScans | None = None,
        get_up: Policy | None = None,
        note_sources: Sequence[Notes] = (),
    ) -> None:
        """Create a runner whose policies have not started.

        Args:
            policies: selectable policies.
            steering: requests to the policies.
            joint_rate_hz: rate of the loop.
            limit_s: longest duration of a step.
            realtime: whether steps are timed. Simulated time waits for them.
            arm: sets a deadline for a step.
            height_scans: height scans for the policies; None if no policy uses them.
            get_up: get-up policy for falls; None for none.
            note_sources: further sources of notes for the log.

        Raises:
            UserError: a policy is faster than the loop.
        """
        all_policies = [*policies.policies, *([] if get_up is None else [get_up])]
        for policy in all_policies:
            if not 0.0 < policy.rate_hz <= joint_rate_hz:
                raise UserError(
                    f"policy '{policy.name}' runs at {policy.rate_hz:g} Hz,"
                    f" the joint loop at {joint_rate_hz:g} Hz: the policy cannot be faster"
                )
        self._policies, self.steering = policies, steering
        self._limit_s, self._realtime, self._arm = limit_s, realtime, arm
        self._height_scans, self._get_up = height_scans, get_up
        self._walker = policies.current.policy.name  # policy for walking on after a fall
        self._process = os.getpid()
        self._began_us, self._begun = 0, False
        self.signals = PolicySignals()
        self.decision: np.ndarray | None = None  # rows of a `JointCommand`
        self.durations_ms = Durations()
        self._command = np.zeros(3)  # last command to the policy
        self._applied, self._logged = applied_of(policies.current.policy), NOTHING_APPLIED
        self._changes: list[Change] = []  # not logged yet
        self._notes_logged = 0
        scanning = [] if height_scans is None else [height_scans]
        sources: list[Notes] = [*all_policies, *scanning, *note_sources]
        self._sources = [NoteSource(each) for each in sources]

    @property
    def notes(self) -> list[str]:
        """Notes of the run: changed requests and others, one line each."""
        notes = self.steering.notes
        for source in self._sources:
            notes.extend(source.new())
        return notes

    def log_step(self, now_us: int, log: RunLog, step: tuple[PolicyInput, np.ndarray] | None) -> None:
        """Log a step, with changes that are not logged yet; None for a failed step."""
        for change in self._changes:
            log.change(now_us, change)
        self._changes.clear()
        if step is not None:
            log.policy_step(now_us, step[0], JointCommand.of(step[1]), self._policies.current.policy)
        if self._applied != self._logged:
            self._logged = self._applied
            log.applied(now_us, self._applied)

    def log_orders_and_notes(self, now_us: int, log: RunLog) -> None:
        """Log orders and notes that are not logged yet, in any mode."""
        for order in self.steering.take_orders():
            log.order(now_us, order)
        notes = self.notes
        for note in notes[self._notes_logged :]:
            log.note(now_us, note)
        self._notes_logged = len(notes)

    def status(
        self, now_us: int, state: State, estimate: tuple[np.ndarray, float, Pose], battery: BatteryState
    ) -> Status:
        """Snapshot of the run, for the command source.

        Args:
            now_us: time of the loop.
            state: state of the supervisor.
            known: velocity of the base (3,) m/s, body frame, its height m and pose.
            battery: state of the battery.
        """
        walking_s = self.time_s(now_us) if state.mode in DECIDING else 0.0
        steering = self.steering
        return Status(
            now_us * 1e-6,
            walking_s,
            state.mode,
            self._policies.current.policy.name,
            self._command,
            *estimate,
            state.faults,
            self.notes,
            steering.offer,
            battery,
            steering.autonomous,
            self._applied,
        )

    def start(self, now_us: int) -> None:
        """Start the policy."""
        self._began_us, self._begun = now_us, True
        self._policies.begin()

    def get_up(self, now_us: int) -> None:
        """Switch to the get-up policy, from the walking policy."""
        assert self._get_up is not None
        if not self._begun:  # the robot has not stood yet
            self.start(now_us)
        if self._policies.current.policy is not self._get_up:  # already so in a second try
            self._walker = self._policies.current.policy.name
        self._take_over(now_us, self._get_up.name)

    def walk_on(self, now_us: int) -> None:
        """Switch back to the policy that walked before the fall, with its own gait and settings."""
        self._take_over(now_us, self._walker)
        self.steering.serve(self._walker)

    def _take_over(self, now_us: int, policy: str) -> None:
        change = Change(policy=policy, at_once=True)
        self._policies.apply(change, now_us - self._began_us)
        self._changes.append(change)
        self.decision = None

    def time_s(self, now_us: int) -> float:
        """Time since the policy took control, s."""
        return (now_us - self._began_us) * 1e-6

    def due(self, now_us: int) -> bool:
        """Whether a step is due."""
        return self._policies.due(now_us - self._began_us)

    def stance(self) -> np.ndarray | None:
        """Contact plan of the policy; None before its first step, or after a failure, which is in
        `signals`."""
        if self.decision is None:  # before its reset a policy has the plan of another episode
            return None
        try:
            return self._policies.stance()
        except FAILURES as error:
            self._note_failure(error)
            return None

    def footholds(self) -> np.ndarray | None:
        """Planned footholds (see `PlansFootholds`); None if the policy plans none."""
        policy = self._policies.current.policy
        if self.decision is None or not hasattr(policy, "footholds"):
            return None
        try:
            return policy.footholds()
        except FAILURES as error:
            self._note_failure(error)
            return None

    def poll(self, now_us: int, run: Run) -> None:
        """Poll the command source while the policy does not decide; a failure is in `signals`."""
        try:
            self.steering.poll(now_us, run, follow=False)
        except FAILURES as error:
            self._note_failure(error)

    def step(
        self,
        now_us: int,
        run: Run,
        sensed: Sensed,
        estimate: tuple[np.ndarray, float],
        walking: bool,
    ) -> tuple[PolicyInput, np.ndarray] | None:
        """Run one step; returns the policy's input and its decision, or None after a failure or timeout.

        Args:
            now_us: time of the loop.
            run: the run, for the command source.
            sensed: latest readings.
            estimate: velocity of the base (3,) m/s, body frame, and its height m.
            walking: whether commands come from the source; otherwise they are zero.
        """
        started = time.perf_counter()
        try:
            try:
                self._arm(self._limit_s)
                inputs, decision = self._decide(now_us, run, sensed, estimate, walking)
            finally:
                self._arm(0.0)
                if os.getpid() != self._process:  # a forked copy must not control the robot
                    os._exit(FORK_EXIT_STATUS)
        except OverdueError:
            self.signals = self.signals._replace(step_s=math.inf)
            return None
        except FAILURES as error:
            self._note_failure(error)
            return None
        finite = math.isfinite(np.add.reduce(decision, axis=None))
        took_s = time.perf_counter() - started
        self.decision = decision
        self.durations_ms.add(took_s * 1e3)
        if self._realtime:
            late = self.signals.late_steps + 1 if took_s * 1e6 > self._policies.period_us else 0
            self.signals = self.signals._replace(command_finite=finite, late_steps=late, step_s=took_s)
        elif finite is not self.signals.command_finite:
            self.signals = self.signals._replace(command_finite=finite)
        return inputs, decision

    def _decide(
        self,
        now_us: int,
        run: Run,
        sensed: Sensed,
        estimate: tuple[np.ndarray, float],
        walking: bool,
    ) -> tuple[PolicyInput, np.ndarray]:
        steering, policies, walked_us = self.steering, self._policies, now_us - self._began_us
        steering.poll(now_us, run, walking)
        for change in steering.take_changes():
            policies.apply(change, walked_us)
            self._changes.append(change)
            steering.refresh(policies.current.policy)
        self._command = ZERO_COMMAND if policies.leaving else steering.command
        scan = None if self._height_scans is None else self._height_scans.fresh(now_us)
        inputs = PolicyInput(walked_us * 1e-6, sensed, self._command, *estimate, scan)
        before = policies.current
        decision = policies.step(walked_us, inputs)
        if policies.current is not before:
            steering.serve(policies.current.policy.name)
        self._applied = applied_of(policies.current.policy)
        return inputs, decision

    def _note_failure(self, error: BaseException) -> None:
        self.signals = self.signals._replace(error=f"the policy failed: {type(error).__name__}: {error}")
