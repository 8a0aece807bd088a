"""The control loop: readings in, a policy's decision at its own rate, commands out at the joint rate."""

import math
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from itertools import cycle
from pathlib import Path
from typing import Protocol

import numpy as np

from footfall.common.errors import UserError
from footfall.common.rotations import tilt
from footfall.deploy.bus import Bus
from footfall.deploy.clock import Clock
from footfall.deploy.commands import CommandLimits
from footfall.deploy.config import DeployConfig
from footfall.deploy.deadline import Arm, OverdueError, unarmed
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.estimation.odometry import Odometry
from footfall.deploy.first_rest import FirstRest
from footfall.deploy.frames import Frames
from footfall.deploy.joint_layer import JointLayer, MotorHealth
from footfall.deploy.pose import impossible_pose
from footfall.deploy.postures import Ending, Postures
from footfall.deploy.safety import DAMPED, DECIDING, HELD, Implausible, Mode, Signals, State, advance, damped
from footfall.deploy.sensor_checks import SensorChecks
from footfall.deploy.timing import Timing
from footfall.deploy.wiring import Wiring
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

CommandSource = Callable[[float], np.ndarray]  # time since walking began, s, to (3,)
ODOMETRY_EVERY_US = 20_000  # for the log
ENDING = (Mode.STOPPING, Mode.LOWERING)  # that may be cut short
POSED = (Mode.STANDING, Mode.LOWERING)  # between two postures
OFF_US = 250_000  # how long motors are asked to switch off: two heartbeats of those that answer by them
POLICY_FAILS = (Exception, SystemExit)  # one that quits fails, too; what else ends a program is not its own
UNKNOWN = (np.full(3, np.nan), math.nan)  # velocity and height that nobody estimates


class Estimator(Protocol):
    """Estimates the base's velocity (3,) m/s, body frame, and height m from readings."""

    def reset(self, sensed: Sensed) -> None: ...

    def start(self) -> None:
        """The pose is zero here and now: the policy takes over."""

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]: ...

    def odometry(self) -> Odometry: ...


class Log(Protocol):
    """What the loop tells a log. Nothing here may block."""

    def tick(
        self, now_us: int, sensed: Sensed, motors: MotorHealth, commanded: np.ndarray | None
    ) -> None: ...

    def policy_step(self, now_us: int, inputs: PolicyInput, command: JointCommand) -> None: ...

    def odometry(self, now_us: int, found: Odometry) -> None: ...

    def state(self, now_us: int, state: State) -> None: ...

    def note(self, now_us: int, note: str) -> None: ...


class ControlLoop:
    """Runs a policy on a robot behind a bus. Call `tick` until it returns False."""

    def __init__(
        self,
        robot: Robot,
        policy: Policy,
        wiring: Wiring,
        driver: Driver,
        bus: Bus,
        clock: Clock,
        config: DeployConfig,
        command_source: CommandSource,
        estimator: Estimator | None = None,
        lie_down: bool = False,
        stand_up: bool = True,
    ) -> None:
        """`lie_down` before the motors go off, where robot and fault permit it.

        A robot that shall not `stand_up`, since it hangs in a frame, holds the pose in which it is found.

        Raises UserError if the policy wants to be called more often than joints are.
        """
        if not 0.0 < policy.rate_hz <= config.joint_rate_hz:
            raise UserError(
                f"policy '{policy.name}' runs at {policy.rate_hz:g} Hz,"
                f" the joint loop at {config.joint_rate_hz:g} Hz: the policy cannot be faster"
            )
        self._policy, self._bus, self._clock, self._config = policy, bus, clock, config
        self._driver = driver
        self._command_source, self._estimator = command_source, estimator
        contract = policy.contract
        self._command_limits = CommandLimits(None if contract is None else contract.commands)
        self.log: Log | None = None
        self.arm: Arm = unarmed  # sets a deadline for the policy
        self.heartbeat_s = math.inf  # when the last tick began, by `time.perf_counter`
        self.taken_over: Callable[[], bool] = lambda: False  # whether somebody else has the robot in hand
        self._robot = robot
        self._postures = Postures(robot, config, lie_down, stand_up)
        self._places = [wiring.place(joint) for joint in range(len(robot.joint_names))]
        self._joints = JointLayer(robot, driver, wiring.imu_channel, config.tick_us * 1e-6, config.scale)
        safety = config.safety
        self._checks = SensorChecks(robot, wiring, safety.sensors, config.tick_us * 1e-6)
        self._first_rest = FirstRest(safety.still_s, safety.sensors, self._places)
        self._last_resort = cycle(driver.damping(np.full(len(self._places), safety.damping_kd)))
        self._speeds_counted = False  # whether it keeps to what motors can do at their speeds
        self._tick_us = config.tick_us
        self._silence_us = safety.silence_timeout_s * 1e6
        self._period_us = 1e6 / policy.rate_hz
        self._estimate_every_us = round(1e6 / config.estimator_rate_hz)
        self.state = State()
        self.timing = Timing()
        self.now_us = 0
        self._sensed: Sensed | None = None  # of this tick
        self.policy_input: PolicyInput | None = None
        self.estimate = UNKNOWN
        self.base_state: Callable[[], tuple[np.ndarray, float]] | None = None  # instead of an estimate
        self.asked_command = np.zeros(3)  # of the last policy step
        self.silent_at_the_end: list[str] = []  # motors that did not answer when they were switched off
        self._logged_notes: set[str] = set()
        self.walked_s = 0.0  # once the robot walks no more
        self._begun_us = 0
        self._estimated_us = -1
        self._next_odometry_us = 0
        self._next_policy_us = 0.0  # half a microsecond early, so that rounding cannot cost a tick
        self._decision: np.ndarray | None = None  # rows as of `JointCommand`
        self._decision_finite = True
        self._late_steps = 0
        self._step_s = 0.0
        self._policy_error = ""
        self._refused = 0
        self._skipped_share = 0.0
        self._finish = False
        self._at_once = False

    @property
    def notes(self) -> list[str]:
        """What had to be changed of what was asked for, one line each."""
        return [*self._command_limits.notes, *self._policy.notes]

    @property
    def walking(self) -> bool:
        """Whether the policy is in charge."""
        return self.state.mode is Mode.WALKING

    @property
    def ticks_skipped(self) -> int:
        """Joint ticks that came so late that they were left out."""
        if not self.now_us:
            return 0
        came = self.timing.tick_us.count + self.state.over  # the last tick is not timed
        return self.now_us // self._config.tick_us + 1 - came

    @property
    def walking_s(self) -> float:
        """Time since the policy took over, s."""
        return (self.now_us - self._begun_us) * 1e-6

    @property
    def sensed(self) -> Sensed:
        """The latest readings. Not every tick needs them in this form."""
        if self._sensed is None:
            self._sensed = self._joints.sensed()
        return self._sensed

    @property
    def temperature_c(self) -> np.ndarray:
        """Of the motors, degrees Celsius, (n,); NaN where one does not say."""
        return self._joints.temperature_c

    @property
    def damping_ticks(self) -> int:
        """The most ticks that it takes to damp the robot and switch its motors off."""
        return math.ceil(self._config.safety.damping_s * 1e6 / self._tick_us) + 2

    @property
    def target(self) -> np.ndarray:
        """Position targets that went out last, rad, (n,)."""
        return self._joints.target

    def finish(self, at_once: bool = False) -> None:
        """Ask for the end of the run: the robot lies down if it can, is damped, then its motors go off.

        It comes to a stand first, if it walks. `at_once`, or asked again, it does neither.
        """
        self._at_once |= at_once or self.state.mode in ENDING
        self._finish = True

    def tick(self) -> bool:
        """One joint tick. Returns False once the run is over and the motors are off.

        Whatever goes wrong in it, the robot is damped, and only then switched off. What is raised to end the
        whole program (KeyboardInterrupt, SystemExit) is not kept back: hand it to `fail`, and go on.
        """
        before_us, self.now_us = self.now_us, self._clock.next_tick()
        if self.taken_over():
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
            self.timing.lateness_us.add(self._clock.lateness_us())
            self.timing.overruns += work_us > self._config.tick_us
        return True

    def _act(self, elapsed_us: int) -> None:
        """Readings in, decisions, frames out."""
        now_us, joints = self.now_us, self._joints
        joints.absorb(self._bus.receive(now_us), now_us)
        self._sensed = None
        signals = self._signals(elapsed_us)
        self._supervise(signals)
        mode = self.state.mode
        if mode in DECIDING:
            self._estimate_base()
            if now_us >= self._next_policy_us:
                self._policy_step()
                after = self._after_policy(signals)
                if after is not signals:
                    self._supervise(after)
                    mode = self.state.mode
        frames = self._driver.disable() if self.state.over else self._frames(mode)
        if self.taken_over():  # while this tick lasted: nothing may go out over a guard's damping
            self._stand_back()
            return
        self._refused += self._bus.send(frames, now_us)
        if self.log is not None:
            nothing_commanded = mode is Mode.IDLE or self.state.over
            commanded = None if nothing_commanded else joints.sent
            self.log.tick(now_us, self.sensed, joints.health(now_us), commanded)
            self._log_odometry(now_us)

    def fail(self, error: BaseException) -> None:
        """What is left after an exception: damping frames that need no reading, then motors off.

        Nothing is raised here, whatever the bus or the log raise.
        """
        now_s, config = self.now_us * 1e-6, self._config.safety
        before = state = self.state
        if state.mode in DAMPED:
            self.state = damped(state, now_s, config)
        else:
            if state.mode is Mode.WALKING:
                self.walked_s = self.walking_s
            self.state = State(
                Mode.ESTOP, now_s, (*state.faults, f"the control loop failed: {_where(error)}")
            )
        with suppress(BaseException):
            frames = self._driver.disable() if self.state.over else self._damping_by_itself()
            self._bus.send(frames, self.now_us)
        if self.log is not None and self.state is not before:
            with suppress(BaseException):
                self.log.state(self.now_us, self.state)

    def _stand_back(self) -> None:
        """The end of a run that a guard had to end: the robot was damped, and its motors are off."""
        if self.state.mode is Mode.WALKING:
            self.walked_s = self.walking_s
        fault = "the loop did not come back in time: a guard damped the robot and switched its motors off"
        self.state = State(Mode.ESTOP, self.now_us * 1e-6, (*self.state.faults, fault), over=True)
        if self.log is not None:
            self.log.state(self.now_us, self.state)

    def _damping_by_itself(self) -> Frames:
        """Frames that damp without a reading, less where motors cannot brake so much at the speeds read last.

        Should those be what fails, the frames are those made beforehand.
        """
        if not self._speeds_counted:
            self._speeds_counted = True
            with suppress(BaseException):
                kd = self._joints.possible_damping(self._config.safety.damping_kd)
                self._last_resort = cycle(self._driver.damping(kd))
        return next(self._last_resort)

    def damp(self) -> None:
        """Send damping frames, whatever happened before."""
        self._bus.send(self._damping_by_itself(), self.now_us)

    def shut_down(self) -> None:
        """Switch the motors off, whatever happened before: again and again, until each has answered.

        What a motor says two ticks after the first request is the answer to one, since nothing else is asked;
        one that speaks by itself has to say that it is off.
        Ends after `OFF_US`; a motor that has not answered by then is in `silent_at_the_end`.
        """
        began_us = now_us = self._clock.next_tick()
        while now_us - began_us <= OFF_US:
            with suppress(BaseException):
                self._joints.absorb(self._bus.receive(now_us), now_us)
            unanswered = self._joints.last_heard().motor_us < began_us + 2 * self._tick_us
            waiting = np.flatnonzero(unanswered | self._driver.not_confirmed_off())
            self.silent_at_the_end = [self._places[joint] for joint in waiting]
            if not self.silent_at_the_end:
                return
            with suppress(BaseException):
                self._bus.send(self._driver.disable(), now_us)
            now_us = self._clock.next_tick()

    # -- what goes out -------------------------------------------------------------------------------

    def _frames(self, mode: Mode) -> Frames:
        if mode in DECIDING and self._decision is not None:
            return self._joints.command(self._decision)
        if mode is Mode.STANDING:
            self._estimate_base()
        if mode in HELD:
            return self._joints.command(self._postures.command(self.now_us * 1e-6 - self.state.since_s))
        if mode in DAMPED:
            return self._joints.damping(self._config.safety.damping_kd)
        return self._driver.query_settings() if self._driver.not_ready() else self._driver.enable()

    # -- what the policy decides ---------------------------------------------------------------------

    def _policy_step(self) -> None:
        """One policy step, timed."""
        now_us = self.now_us
        started = time.perf_counter()
        limit_s = self._config.safety.late_limit_s
        try:
            try:
                self.arm(limit_s)
                inputs, decision = self._decided(now_us)
            finally:
                self.arm(0.0)
        except OverdueError:
            self._step_s = math.inf
            return
        except POLICY_FAILS as error:
            self._policy_error = f"the policy failed: {type(error).__name__}: {error}"
            return
        self._decision_finite = math.isfinite(np.add.reduce(decision, axis=None))
        took_s = time.perf_counter() - started
        self.policy_input, self._decision = inputs, decision
        self.timing.policy_ms.add(took_s * 1e3)
        if self._clock.realtime:  # simulated time waits
            self._step_s = took_s
            self._late_steps = self._late_steps + 1 if took_s * 1e6 > self._period_us else 0
        periods = math.ceil((now_us - self._next_policy_us) / self._period_us)
        self._next_policy_us += self._period_us * max(1, periods)
        if self.log is not None:
            self.log.policy_step(now_us, inputs, JointCommand.of(decision))
            for note in self.notes:
                if note not in self._logged_notes:
                    self.log.note(now_us, note)
                    self._logged_notes.add(note)

    def _decided(self, now_us: int) -> tuple[PolicyInput, np.ndarray]:
        """What the policy is shown, and what it makes of that (5, n)."""
        time_s = (now_us - self._begun_us) * 1e-6
        asked = self._command_source(time_s) if self.walking else np.zeros(3)
        self.asked_command = np.asarray(asked, dtype=float)
        command = self._command_limits.apply(self.asked_command)
        velocity, height = self.estimate
        inputs = PolicyInput(time_s, self.sensed, command, velocity, height)
        if self._decision is None:
            self._policy.reset(inputs)
        return inputs, self._checked(self._policy.act(inputs))

    def _checked(self, decision: JointCommand) -> np.ndarray:
        """A copy of a decision, (5, n). Raises ValueError for one of a wrong shape."""
        values = np.array(decision, dtype=float)
        if values.shape != (5, len(self._places)):
            raise ValueError(f"it decides on shape {values.shape}, expected (5, {len(self._places)})")
        return values

    def _estimate_base(self) -> None:
        if self.base_state is not None:
            self.estimate = self.base_state()
        elif self._estimator is not None:
            elapsed_us = self.now_us - self._estimated_us
            due = self.state.mode in DECIDING and self.now_us >= self._next_policy_us
            if due or elapsed_us >= self._estimate_every_us:
                begun = self._decision is not None  # before its reset a policy's plan is of an episode before
                try:
                    stance = self._policy.stance() if begun else None
                except POLICY_FAILS as error:
                    self._policy_error = f"the policy failed: {type(error).__name__}: {error}"
                    return
                self.estimate = self._estimator.update(self.sensed, stance, elapsed_us * 1e-6)
                self._estimated_us = self.now_us

    def _log_odometry(self, now_us: int) -> None:
        """Now and then while walking, which is when the pose means something."""
        if self.log is None or self._estimator is None or not self.walking:
            return
        if now_us >= self._next_odometry_us:
            self._next_odometry_us = now_us + ODOMETRY_EVERY_US
            self.log.odometry(now_us, self._estimator.odometry())

    # -- what may not go wrong -----------------------------------------------------------------------

    def _supervise(self, signals: Signals) -> None:
        before = self.state
        self.state = advance(before, signals, self._config.safety)
        if self.state is before or self.state.mode is before.mode:
            return
        if before.mode is Mode.WALKING:
            self.walked_s = self.walking_s
        if self.state.mode is Mode.STANDING:
            sensed = self.sensed
            sunk = self._checks.monitor.sunk_share(sensed.joint_position, sensed.quaternion)
            self._postures.stand_up(sensed.joint_position, sunk)
            self._joints.begin_at(sensed.joint_position)
            self._begin_checks()
            self._estimated_us = self.now_us
            if self._estimator is not None:
                self._estimator.reset(self.sensed)
        elif self.state.mode is Mode.LOWERING:
            self._postures.lie_down(self._joints.target, self._ending(before.mode))
        elif self.state.mode is Mode.WALKING:
            self._begun_us = self.now_us
            self._next_policy_us = self.now_us - 0.5
            if self._estimator is not None:
                self._estimator.start()
        if self.log is not None:
            self.log.state(self.now_us, self.state)

    def _ending(self, before: Mode) -> Ending:
        """How a robot is found that shall lie down; one that stands up has all feet on the ground."""
        if before is Mode.STANDING:
            return Ending.STANDING
        return Ending.WALKING if self.state.faults else Ending.STOPPED

    def _signals(self, elapsed_us: int) -> Signals:
        joints, now_us, state = self._joints, self.now_us, self.state
        mode = state.mode
        motor_us, imu_us, motor_error = joints.last_heard()
        oldest = int(motor_us.argmin())
        motor_silence_us, imu_silence_us = now_us - int(motor_us[oldest]), now_us - imu_us
        now_s = now_us * 1e-6
        held = mode in HELD
        implausible = self._contradiction(max(motor_silence_us, imu_silence_us)) if held else None
        posed = mode in POSED and self._postures.done(now_s - state.since_s)
        signals = Signals(
            now_s=now_s,
            motor_silence_s=motor_silence_us * 1e-6,
            silent_motor=self._places[oldest],
            imu_silence_s=imu_silence_us * 1e-6,
            motor_error=self._error_of(motor_error) if np.count_nonzero(motor_error) else "",
            tilt_rad=tilt(joints.inertial.quaternion),
            command_finite=self._decision_finite,
            late_steps=self._late_steps,
            step_s=self._step_s,
            frames_refused=self._refused,
            bus_fault=self._bus.fault(),
            policy_error=self._policy_error,
            oldest_of_imu="" if imu_silence_us <= self._silence_us else joints.oldest_of_imu,
            implausible=implausible,
            pause_s=elapsed_us * 1e-6,
            skipped_share=self._skipped(elapsed_us),
            stand_done=posed,
            finish=self._finish and mode not in DAMPED,
            may_lie=self._postures.may_lie,
            stopped=mode is Mode.STOPPING and now_s - state.since_s >= self._config.stop_s,
            lain_down=posed,
            at_once=self._at_once,
        )
        if mode is not Mode.IDLE:
            return signals
        heard, rest = motor_silence_us <= self._silence_us, self._first_rest
        if heard and imu_silence_us <= self._silence_us:
            rest.look(now_us, joints.inertial, joints.joints[1])
        return signals._replace(
            first_pose=self._first_pose() if heard else "",
            implausible=(self._first_readings() or rest.contradiction()) if heard else None,
            unready=self._driver.not_ready() or self._driver.not_enabled() or rest.awaited(now_us),
        )

    def _first_pose(self) -> str:
        position, limit = self._joints.joints[0], self._config.safety.first_pose_rad
        return impossible_pose(self._robot, self._places, position, limit)

    def _first_readings(self) -> Implausible | None:
        """What a motor may not say when it is to get stiffness: that it is hot, too fast, without voltage."""
        joints, monitor = self._joints, self._checks.monitor
        self._begin_checks()
        monitor.temperature, monitor.voltage = joints.temperature_c, joints.voltage
        return self._checks.of_joints()

    def _begin_checks(self) -> None:
        """Readings are compared from now on."""
        joints, heard_us = self._joints, self._joints.last_heard().motor_us
        self._checks.monitor.begin(self.now_us, heard_us, joints.inertial, joints.joints, joints.target)

    def _contradiction(self, silence_us: int) -> Implausible | None:
        """Readings that contradict each other, if this is a tick at which they are compared.

        The joints' are, and in the next tick the body's: one tick would have much more work than the others.
        """
        joints, checks, now_us = self._joints, self._checks, self.now_us
        monitor = checks.monitor
        since_s, deciding = now_us * 1e-6 - self.state.since_s, self.state.mode in DECIDING
        monitor.on_legs = self._postures.on_legs(since_s, deciding)
        found = checks.of_body() if monitor.look_at_body() else None
        if found is not None or not monitor.due(now_us):
            return found
        heard_us, expected = joints.last_heard().motor_us, joints.expected_torque()
        if not monitor.add(now_us, silence_us, heard_us, joints.inertial, joints.joints, expected):
            return None
        compared = monitor.look(joints.stiffness, joints.target, joints.temperature_c, joints.voltage)
        return checks.of_joints() if compared else None

    def _skipped(self, elapsed_us: int) -> float:
        """Share of the last second's ticks that were left out, older ones counting less and less."""
        tick_us = self._tick_us
        if elapsed_us > tick_us or self._skipped_share:
            weight = min(elapsed_us * 1e-6, 1.0)
            share = (elapsed_us - tick_us) / elapsed_us if elapsed_us else 0.0
            self._skipped_share += weight * (share - self._skipped_share)
        return self._skipped_share

    def _after_policy(self, signals: Signals) -> Signals:
        """Signals with those renewed that a policy step may change: the same where it has changed none."""
        before = signals.command_finite, signals.late_steps, signals.step_s, signals.policy_error
        if before == (self._decision_finite, self._late_steps, self._step_s, self._policy_error):
            return signals
        return signals._replace(
            command_finite=self._decision_finite,
            late_steps=self._late_steps,
            step_s=self._step_s,
            policy_error=self._policy_error,
        )

    def _error_of(self, errors: np.ndarray) -> str:
        joint = int(np.flatnonzero(errors)[0])
        code = int(errors[joint])
        return f"motor {self._places[joint]} reports {self._driver.error_name(code, joint)}"


def _where(error: BaseException) -> str:
    """An exception in one line, with the place that raised it."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    says = ": ".join(filter(None, [type(error).__name__, " ".join(str(error).split())]))
    return f"{says} ({Path(last.filename).name}, line {last.lineno})"
