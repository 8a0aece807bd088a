"""Collects the supervisor's inputs in each tick."""

import numpy as np

from footfall.common.arrays import any_nonzero
from footfall.common.rotations import tilt
from footfall.deploy.bus import Bus
from footfall.deploy.command_source import Stop
from footfall.deploy.config import DeployConfig
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.first_rest import FirstRest
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.modes import HELD, Mode
from footfall.deploy.pose import impossible_pose
from footfall.deploy.postures import Postures
from footfall.deploy.recovery import Recovery
from footfall.deploy.run_end import RunEnd
from footfall.deploy.safety import State
from footfall.deploy.sensor_checks.monitor import SensorMonitor
from footfall.deploy.signals import (
    BusSignals,
    Implausible,
    ImuSignals,
    MotorSignals,
    PolicySignals,
    Signals,
    StartSignals,
    TimeSignals,
    WiringSignals,
)
from footfall.deploy.skipped_ticks import SkippedTicks
from footfall.deploy.wiring import Wiring
from footfall.deploy.wiring_check.check import WiringCheck
from footfall.robots.description import Robot

POSED = (Mode.STANDING, Mode.LOWERING)  # between two postures
OFF_LEGS = (Mode.CHECKING, Mode.RECOVERING)  # the legs need not support the base
RESTING = (Mode.CHECKING, Mode.STANDING)  # the message rates measured then are the reference for later ones
NOTHING_AT_START = StartSignals()
NO_WIRING_CHECK = WiringSignals()


class SignalSource:
    """Collects readings and the states of buses and loop for the supervisor."""

    def __init__(
        self,
        robot: Robot,
        wiring: Wiring,
        driver: Driver,
        bus: Bus,
        joints: JointLayer,
        postures: Postures,
        end: RunEnd,
        config: DeployConfig,
        wiring_check: WiringCheck | None,
        recovery: Recovery,
    ) -> None:
        safety, tick_s = config.safety, config.tick_us * 1e-6
        self._robot, self._driver, self._bus = robot, driver, bus
        self._joints, self._postures, self._end = joints, postures, end
        self._wiring_check, self._recovery = wiring_check, recovery
        self._channel, self._buses = wiring.channel, wiring.buses
        self._labels = [wiring.label(joint) for joint in range(len(robot.joint_names))]
        answering = getattr(driver, "answers_each_frame", False)
        self._monitor = SensorMonitor(robot, wiring, safety.sensors, tick_s, answering=answering)
        self._first_rest = FirstRest(safety.still_s, safety.sensors, self._labels)
        self._first_pose_rad = safety.first_pose_rad
        self._silence_us = safety.silence_timeout_s * 1e6
        self._skipped = SkippedTicks(config.tick_us)
        self.frames_refused = 0  # so far

    def begin_checks(self, now_us: int, again: bool = False) -> None:
        """Restart the sensor checks; with `again` the reference rates of messages are kept."""
        joints = self._joints
        self._monitor.begin(
            now_us, joints.last_arrivals().motor_us, joints.inertial, joints.joints, joints.target, again
        )
        self._monitor.begin_links(now_us, joints)

    def update(
        self,
        now_us: int,
        elapsed_us: int,
        state: State,
        policy: PolicySignals,
        stop: Stop | None,
        get_up_requested: bool = False,
    ) -> Signals:
        """The signals of a tick.

        Args:
            now_us: the loop's time.
            elapsed_us: time since the previous tick.
            state: state of the supervisor.
            policy: signals of the policy.
            stop: stop requested from outside; None without one.
            get_up_requested: whether an operator requests getting up.
        """
        joints, mode = self._joints, state.mode
        motor_us, imu_us, motor_error = joints.last_arrivals()
        arrived_us = motor_us.tolist()
        oldest_us = min(arrived_us)
        oldest = arrived_us.index(oldest_us)
        motor_silence_us, imu_silence_us = now_us - oldest_us, now_us - imu_us
        now_s = now_us * 1e-6
        since_s = now_s - state.since_s
        implausible, start = None, NOTHING_AT_START
        if mode in HELD:
            on_legs = mode not in OFF_LEGS and self._postures.on_legs(since_s, mode)
            silence_us, resting = max(motor_silence_us, imu_silence_us), mode in RESTING
            unfolding = mode is Mode.RECOVERING and not self._postures.unfolded(since_s)
            implausible = self._monitor.update(now_us, silence_us, joints, on_legs, resting, unfolding)
        elif mode is Mode.IDLE:
            start, implausible = self._at_start(now_us, motor_silence_us, imu_silence_us)
        ending = stop is not None or self._end.requested
        recovery = self._recovery.signals(now_us, state, joints, ending, get_up_requested)
        if recovery.ready:
            implausible = self._monitor.first_contradiction(joints)
        check = self._wiring_check
        if check is not None and mode is Mode.CHECKING:
            check.update(since_s, joints.sensed())
        return Signals(
            now_s,
            MotorSignals(
                motor_silence_us * 1e-6,
                self._labels[oldest]
                if motor_silence_us <= self._silence_us
                else self._name_of_silent(motor_us, now_us, oldest),
                self._error_of(motor_error) if any_nonzero(motor_error) else "",
            ),
            ImuSignals(
                imu_silence_us * 1e-6,
                tilt(joints.inertial.quaternion),
                "" if imu_silence_us <= self._silence_us else joints.oldest_of_imu,
            ),
            policy,
            BusSignals(self.frames_refused, self._bus.fault()),
            TimeSignals(elapsed_us * 1e-6, self._skipped.share(elapsed_us)),
            start,
            self._end.signals(mode, since_s),
            implausible,
            NO_WIRING_CHECK if check is None else check.signals,
            mode in POSED and self._postures.done(since_s),
            stop,
            joints.battery.fault,
            recovery,
        )

    def _at_start(
        self, now_us: int, motor_silence_us: int, imu_silence_us: int
    ) -> tuple[StartSignals, Implausible | None]:
        """Reasons against the start, once all motors have answered."""
        motors_replied, rest, joints = motor_silence_us <= self._silence_us, self._first_rest, self._joints
        if motors_replied and imu_silence_us <= self._silence_us:
            rest.update(now_us, joints.inertial, joints.joints[1])
        not_ready = self._driver.not_ready() or self._driver.not_enabled() or rest.not_at_rest(now_us)
        if not motors_replied:
            return StartSignals(not_ready), None
        pose = impossible_pose(self._robot, self._labels, joints.joints[0], self._first_pose_rad)
        implausible = self._monitor.first_contradiction(joints) or rest.contradiction()
        return StartSignals(not_ready, pose), implausible

    def _name_of_silent(self, motor_us: np.ndarray, now_us: int, oldest: int) -> str:
        """Name of the silent motor; "any motor" (on its bus) if all of them are silent."""
        silent, channel = now_us - motor_us > self._silence_us, self._channel[oldest]
        on_same_bus = silent[self._channel == channel]
        if silent.all() and len(silent) > 1:
            return "any motor"
        if on_same_bus.all() and len(on_same_bus) > 1:
            return f"any motor on {self._buses[channel]}"
        return self._labels[oldest]

    def _error_of(self, errors: np.ndarray) -> str:
        joint = int(np.flatnonzero(errors)[0])
        code = int(errors[joint])
        return f"motor {self._labels[joint]} reports {self._driver.error_name(code, joint)}"
