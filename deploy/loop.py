"""Control loop: readings in, policy decisions at their own rate, commands out at the joint rate."""

import math
import time
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from footfall.deploy.base_estimate import BaseEstimate
from footfall.deploy.battery import BatteryState, battery_monitor
from footfall.deploy.bus import Bus
from footfall.deploy.clock import Clock
from footfall.deploy.command_source import Status
from footfall.deploy.config import DeployConfig
from footfall.deploy.deadline import OverdueError
from footfall.deploy.drivers.choice import open_imu
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.drivers.foot_force import FootForceReader
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.last_resort import LastResort, in_one_line
from footfall.deploy.mode_actions import ModeActions
from footfall.deploy.modes import DAMPED, DECIDING, Mode
from footfall.deploy.policy_runner import PolicyRunner
from footfall.deploy.postures import Postures
from footfall.deploy.recovery import Recovery
from footfall.deploy.run_end import TAKEN_OVER, RunEnd
from footfall.deploy.run_log import RunLog
from footfall.deploy.safety import State, advance, damped
from footfall.deploy.signal_source import SignalSource
from footfall.deploy.signals import Signals
from footfall.deploy.timing import Timing
from footfall.deploy.wiring import Wiring
from footfall.deploy.wiring_check.check import WiringCheck
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot


class ControlLoop:
    """Runs a policy on a robot behind a bus. Call `tick` until it returns False."""

    def __init__(
        self,
        robot: Robot,
        wiring: Wiring,
        driver: Driver,
        bus: Bus,
        clock: Clock,
        config: DeployConfig,
        runner: PolicyRunner,
        estimate: BaseEstimate,
        log: RunLog | None = None,
        lie_down: bool = False,
        stand_up: bool = True,
        taken_over: Callable[[], bool] = lambda: False,
        wiring_check: WiringCheck | None = None,
        recovery: Recovery | None = None,
    ) -> None:
        """Create a loop that has not started.

        Args:
            robot: robot with joints and limits.
            wiring: buses and ids of the motors.
            driver: driver of the motors' protocol.
            bus: bus to the robot.
            clock: clock of the ticks.
            config: settings of the loop.
            runner: runner of the policy.
            estimate: estimate of the base's velocity and height.
            log: log of the run; None for none.
            lie_down: whether the robot lies down at the end, if robot and fault permit it.
            stand_up: False for a robot that hangs in a frame: it holds its initial pose.
            taken_over: whether a guard controls the robot.
            wiring_check: check before the robot stands up and walks; None for none.
            recovery: consent to get up after a fall; None for none.
        """
        self._bus, self._clock, self._config = bus, clock, config
        self._runner, self._estimate, self._log, self._taken_over = runner, estimate, log, taken_over
        kd, battery = config.safety.damping_kd, battery_monitor(robot, config.safety.battery)
        imu, tick_s = open_imu(wiring, config.estimator.attitude), config.tick_us * 1e-6
        feet = FootForceReader(wiring.foot_channel) if robot.foot_sensors else None
        self._joints = JointLayer(robot, driver, imu, tick_s, config.scale, battery, feet)
        self._postures = Postures(robot, config, lie_down, stand_up)
        self._end = RunEnd(self._postures.may_lie, config.stop_s, robot.description.held_start)
        self.recovery = recovery or Recovery(robot, config.safety.recovery, consent=False)
        self._signals = SignalSource(
            robot,
            wiring,
            driver,
            bus,
            self._joints,
            self._postures,
            self._end,
            config,
            wiring_check,
            self.recovery,
        )
        self._actions = ModeActions(
            driver, self._joints, self._signals, estimate, self._postures, runner, wiring_check, kd
        )
        self.last_resort = LastResort(driver, bus, clock, self._joints, wiring, kd, config.tick_us)
        self._sensed: Sensed | None = None  # readings of this tick
        self.timing = Timing(policy_ms=runner.durations_ms)
        self.state, self.now_us = State(), 0
        self.heartbeat_s = math.inf  # start of the last tick, by `time.perf_counter`
        self.walked_s = 0.0  # final value, once the robot no longer walks

    @property
    def walking(self) -> bool:
        """Whether the robot walks with its policy."""
        return self.state.mode is Mode.WALKING

    @property
    def held_up(self) -> bool:
        """Whether a person must hold the robot, which cannot stand still."""
        return self._postures.held_up(self.now_us * 1e-6 - self.state.since_s, self.state.mode)

    @property
    def walking_s(self) -> float:
        """Time since the policy took control, s."""
        return self._runner.time_s(self.now_us)

    @property
    def sensed(self) -> Sensed:
        """Latest readings. Not every tick needs them in this form."""
        if self._sensed is None:
            self._sensed = self._joints.sensed()
        return self._sensed

    @property
    def estimate(self) -> tuple[np.ndarray, float]:
        """Velocity of the base (3,) m/s, body frame, and its height m; NaN without an estimate."""
        return self._estimate.value

    @property
    def requested_command(self) -> np.ndarray:
        """Velocity command of the last policy step, before clipping, (3,)."""
        return self._runner.steering.requested_command

    @property
    def status(self) -> Status:
        """Snapshot of the run, for its command source."""
        base = *self._estimate.value, self._estimate.pose(self.now_us)
        return self._runner.status(self.now_us, self.state, base, self.battery)

    @property
    def battery(self) -> BatteryState:
        """State of the battery."""
        return self._joints.battery

    @property
    def imu_damaged(self) -> int:
        """Number of the IMU's messages so far that were ignored because of a wrong checksum."""
        return self._joints.imu_damaged

    @property
    def target(self) -> np.ndarray:
        """Last position targets, rad, (n,)."""
        return self._joints.target

    @property
    def temperature_c(self) -> np.ndarray:
        """Temperatures of the motors, degrees Celsius, (n,); NaN if not reported."""
        return self._joints.temperature_c

    def tick(self) -> bool:
        """Run one joint tick. Returns False once the run is over and the motors are disabled.

        After any failure the robot is damped, and then its motors are disabled. KeyboardInterrupt and
        SystemExit are not caught: pass them to `fail`, and continue.
        """
        before_us, self.now_us = self.now_us, self._clock.next_tick()
        if self.now_us > before_us:  # the first tick has no previous one
            self.timing.ticks_skipped += (self.now_us - before_us) // self._config.tick_us - 1
        if self._taken_over():
            self._stand_back()
            return False
        started = self.heartbeat_s = time.perf_counter()
        try:
            self._act(self.now_us - before_us)
        except (Exception, OverdueError) as error:
            self.fail(error)
        if self.state.over:
            return False
        work_us = (time.perf_counter() - started) * 1e6
        self.timing.tick_us.add(work_us)
        if self._clock.realtime:
            lateness_us = self._clock.lateness_us()
            self.timing.lateness_us.add(lateness_us)
            if self._log is not None:
                self._log.timing(self.now_us, work_us, lateness_us)
            self.timing.overruns += work_us > self._config.tick_us
        return True

    def _act(self, elapsed_us: int) -> None:
        """Process readings, decide, and send frames."""
        now_us, joints, runner = self.now_us, self._joints, self._runner
        joints.absorb(self._bus.receive(now_us), now_us)
        self._sensed = None
        steering = runner.steering
        signals = self._signals.update(
            now_us, elapsed_us, self.state, runner.signals, steering.stop, steering.get_up
        )
        self._supervise(signals)
        if self._actions.let_decide(self.state, now_us):
            self._decide()
        elif steering.due(now_us):
            runner.poll(now_us, self)
        self._end.finish_if_requested(steering.lie_down, self.state.mode)
        if runner.signals is not signals.policy:
            self._supervise(signals._replace(policy=runner.signals))
        if self.state.mode is Mode.STANDING:
            self._update_estimate()
        frames = self._actions.frames(self.state, now_us)
        if self._taken_over():  # since the tick's start: nothing may be sent after a guard's damping
            self._stand_back()
            return
        self._signals.frames_refused += self._bus.send(frames, now_us)
        if self._log is not None:
            self._log_tick(self._log)

    def _decide(self) -> None:
        """Estimate the base, and run a policy step if it is due."""
        now_us, runner, log = self.now_us, self._runner, self._log
        due = runner.due(now_us)
        if self.state.mode in DECIDING:
            self._update_estimate(due)
        if not due:
            return
        commanded = self.walking and not self.held_up
        step = runner.step(now_us, self, self.sensed, self._estimate.value, commanded)
        if log is not None:
            runner.log_step(now_us, log, step)

    def _update_estimate(self, step_due: bool = False) -> None:
        if self._estimate.due(self.now_us, step_due):
            self._estimate.update(self.now_us, self.sensed, self._runner)

    def _log_tick(self, log: RunLog) -> None:
        now_us, joints = self.now_us, self._joints
        nothing_commanded = self.state.mode is Mode.IDLE or self.state.over
        log.tick(now_us, self.sensed, joints.health(now_us), None if nothing_commanded else joints.sent)
        log.battery(now_us, self.battery)
        self._runner.log_orders_and_notes(now_us, log)
        if self.walking and (odometry := self._estimate.odometry(now_us)) is not None:
            log.odometry(now_us, odometry, self._runner.footholds())

    def _supervise(self, signals: Signals) -> None:
        before = self.state
        self._enter(advance(before, signals, self._config.safety))
        if self.state.mode is not before.mode:
            self._actions.begin(before, self.state, self.now_us, self.sensed)

    def _enter(self, state: State) -> None:
        """Set a new state, update the walking time, and log it."""
        before, self.state = self.state, state
        if state is before or (state.mode is before.mode and state.faults == before.faults):
            return
        if before.mode is Mode.WALKING:
            self.walked_s = self.walking_s - self.recovery.recovery_s
        if note := self.recovery.follow(before, state):
            self._runner.steering.note(note)
        if self._log is not None:
            self._log.state(self.now_us, state)

    def finish(self, skip_lie_down: bool = False) -> None:
        """Request the end of the run: the robot lies down if possible, is damped, then its motors are
        disabled.

        A walking robot stops first. With `skip_lie_down`, or at a second request, it does neither.
        """
        self._end.finish(self.state.mode, skip_lie_down)

    def fail(self, error: BaseException) -> None:
        """After an exception: send damping frames that need no reading, then disable. Raises nothing."""
        now_s, state = self.now_us * 1e-6, self.state
        self.recovery.revoke()
        if state.mode in DAMPED:
            state = damped(state, now_s, self._config.safety)
        else:
            state = State(
                Mode.ESTOP, now_s, (*state.faults, f"the control loop failed: {in_one_line(error)}")
            )
        self.last_resort.send(state.over, self.now_us)
        with suppress(BaseException):
            self._enter(state)

    def _stand_back(self) -> None:
        """End a run after a guard has damped the robot and disabled its motors."""
        self._enter(State(Mode.ESTOP, self.now_us * 1e-6, (*self.state.faults, TAKEN_OVER), over=True))

    def damp(self) -> None:
        """Send damping frames, whatever happened before."""
        self._bus.send(self.last_resort.damping(), self.now_us)

    def shut_down(self) -> None:
        """Disable the motors, whatever happened before (see `LastResort.disable`)."""
        self.last_resort.disable()
