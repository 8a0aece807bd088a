"""Runs all sensor checks on a robot's readings.

Messages are checked at the end of a window, joints in the next tick and the base in the one after it, so that
no tick takes much longer than the others.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from footfall.deploy.clearance import legs_of
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.leg_attitude import LegAttitude
from footfall.deploy.sensor_checks.body_window import BodyReadings, BodyWindow, body_window
from footfall.deploy.sensor_checks.check import BodyCheck, JointCheck
from footfall.deploy.sensor_checks.joint_window import JointWindow, JointWindows, single_reading
from footfall.deploy.sensor_checks.link_window import LinkSums, LinkWindow
from footfall.deploy.sensor_checks.links import LinkCheck
from footfall.deploy.sensor_checks.table import BODY_CHECKS, JOINT_CHECKS, LINK_CHECKS, SensorLimits
from footfall.deploy.signals import Implausible
from footfall.deploy.wiring import Wiring
from footfall.robots.description import Robot


class _AtEnd(NamedTuple):
    """Last command and state of the motors at the end of a window, as for `JointWindows.close`."""

    stiffness: np.ndarray
    target: np.ndarray
    temperature_c: np.ndarray
    voltage: np.ndarray


class SensorMonitor:
    """Sensor checks of one robot."""

    def __init__(
        self,
        robot: Robot,
        wiring: Wiring,
        limits: SensorLimits,
        tick_s: float,
        joint_checks: Sequence[type[JointCheck]] = JOINT_CHECKS,
        body_checks: Sequence[type[BodyCheck]] = BODY_CHECKS,
        link_checks: Sequence[type[LinkCheck]] = LINK_CHECKS,
        answering: bool = True,
    ) -> None:
        """Create the checks for this robot, whose readings come every `tick_s`.

        `answering`: whether its motors reply to each frame, and send nothing else.
        """
        n = len(robot.joint_names)
        self._labels = [wiring.label(joint) for joint in range(n)]
        self._windows = JointWindows(n, limits, tick_s)
        sample_s = self._windows.sample_s
        self._joint_checks = [check(robot, limits, sample_s) for check in joint_checks]
        self._joint_limits = _rows([check.limit.of(robot, limits) for check in joint_checks], n)
        self._body_checks = [
            (check(robot, limits, sample_s), check.limit.of(robot, limits)) for check in body_checks
        ]
        self._link_checks = [
            (check(robot, limits, sample_s), check.limit.of(robot, limits)) for check in link_checks
        ]
        self._links = LinkSums(answering)
        self._resting_rad_s, self._moving_rad_s = limits.resting_rad_s, limits.moving_rad_s
        self._attitude = None if legs_of(robot) is None else LegAttitude(robot, limits)
        self._inertial = Inertial((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0))  # of the last window
        self._closing: _AtEnd | None = None  # for `joint_contradiction`, at the end of a window
        self._body: BodyReadings | None = None  # readings for `body_contradiction`

    def begin(
        self,
        now_us: int,
        arrived_us: np.ndarray,
        inertial: Inertial,
        joints: np.ndarray,
        target: np.ndarray,
        again: bool = False,
    ) -> None:
        """Clear everything, and start with these readings (see `add`) and position targets, rad, (n,).

        `again`: keep the usual rates of messages.
        """
        self._windows.begin(now_us, arrived_us, joints, target)
        self._inertial, self._closing, self._body = inertial, None, None
        links = () if again else self._link_checks
        for check in (*self._joint_checks, *(check for check, _ in (*self._body_checks, *links))):
            check.reset()
        if self._attitude is not None:
            self._attitude.reset()

    def begin_links(self, now_us: int, joints: JointLayer) -> None:
        """Start counting messages."""
        self._links.begin(
            now_us, joints.replies, joints.imu_older, joints.last_arrivals().imu_us, joints.inertial
        )

    def update(
        self,
        now_us: int,
        silence_us: int,
        joints: JointLayer,
        on_legs: bool,
        resting: bool,
        unfolding: bool = False,
    ) -> Implausible | None:
        """Process a tick; returns the first contradiction, if readings are compared in this tick.

        Args:
            now_us: time of the loop.
            silence_us: age of the oldest reading.
            joints: joint layer with the latest readings and commands.
            on_legs: whether the legs should carry the base.
            resting: whether the robot is still standing up.
            unfolding: whether the robot fell, and its legs move before it gets up.
        """
        self._links.count_command()
        found = self.body_contradiction(on_legs)
        if self._closing is not None:
            contradiction, self._closing = self.joint_contradiction(*self._closing), None
            found = found or contradiction
        if found is not None or not self._windows.due(now_us):
            return found
        arrived_us, imu_us, _ = joints.last_arrivals()
        self._links.add(imu_us, joints.inertial)
        if not self.add(
            now_us,
            silence_us,
            arrived_us,
            joints.inertial,
            joints.joints,
            joints.sent,
            joints.sent_before,
            joints.take_torques(),
        ):
            return None
        fast = float(np.abs(joints.joints[1]).max()) > self._moving_rad_s
        # The base of a lying robot is at rest while its legs move.
        moving = fast and (on_legs or not (resting or unfolding))
        self._closing = _AtEnd(joints.stiffness, joints.target, joints.temperature_c, joints.voltage)
        links = self._links.close(now_us, joints.replies, joints.imu_older, moving, resting)
        return self.link_contradiction(links)

    def link_contradiction(self, window: LinkWindow) -> Implausible | None:
        """First contradiction in the messages of a window."""
        found = None
        for check, limit in self._link_checks:
            value = check.measure(window)
            worst, label = value, ""
            if isinstance(value, np.ndarray):
                joint = int(value.argmax())
                worst, label = value[joint], f"{self._labels[joint]}: "
            if found is None and not worst <= limit:
                found = Implausible(label + check.message.format(worst), check.leads_to)
        return found

    def add(
        self,
        now_us: int,
        silence_us: int,
        arrived_us: np.ndarray,
        inertial: Inertial,
        joints: np.ndarray,
        sent: np.ndarray,
        sent_before: np.ndarray,
        commanded: Sequence[np.ndarray],
    ) -> bool:
        """Add readings to the window; returns whether it is full (see `JointWindows.add`)."""
        return self._windows.add(
            now_us, silence_us, arrived_us, inertial, joints, sent, sent_before, commanded
        )

    def joint_contradiction(
        self, stiffness: np.ndarray, target: np.ndarray, temperature_c: np.ndarray, voltage: np.ndarray
    ) -> Implausible | None:
        """End the window (see `JointWindows.close`); returns the first contradiction in joint readings."""
        inertials = self._windows.inertials
        window = self._windows.close(stiffness, target, temperature_c, voltage)
        before, self._inertial = self._inertial, inertials[-1]
        if window is None:
            return None
        fastest = max(window.speed.tolist())
        self._body = BodyReadings(
            window.elapsed_s, before, inertials, window.joints[0], window.torque, fastest
        )
        return self._judged(window, self._joint_checks, self._joint_limits)

    def first_contradiction(self, joints: JointLayer) -> Implausible | None:
        """First contradiction in one reading of the joints, before motors get stiffness."""
        window = single_reading(joints.joints, joints.temperature_c, joints.voltage)
        rows = [row for row, check in enumerate(self._joint_checks) if check.single_reading]
        checks = [self._joint_checks[row] for row in rows]
        return self._judged(window, checks, self._joint_limits[rows])

    def body_contradiction(self, on_legs: bool) -> Implausible | None:
        """First contradiction in the base's readings of the last window; None without new readings."""
        readings, self._body = self._body, None
        if readings is None:
            return None
        window = self._with_attitude(body_window(readings, on_legs))
        found = None
        for check, limit in self._body_checks:
            value = check.measure(window)
            if found is None and not value <= limit:
                found = Implausible(check.message.format(value), check.leads_to)
        return found

    def _judged(
        self, window: JointWindow, checks: Sequence[JointCheck], limits: np.ndarray
    ) -> Implausible | None:
        values = np.array([check.measure(window) for check in checks])
        passed = values <= limits  # NaN fails
        if np.count_nonzero(passed) == passed.size:
            return None
        row, joint = np.argwhere(~passed)[0].tolist()
        message = checks[row].message.format(values[row, joint], window.joints[0, joint])
        return Implausible(f"{self._labels[joint]}: {message}", checks[row].leads_to)

    def _with_attitude(self, window: BodyWindow) -> BodyWindow:
        """The window with the base's attitude by the legs, for a robot that stands nearly at rest."""
        attitude, readings = self._attitude, window.readings
        if attitude is None:
            return window
        if window.on_legs and readings.fastest < self._resting_rad_s:
            attitude.update(readings.position, readings.torque, window.up, readings.elapsed_s)
        else:
            attitude.reset()
        return window._replace(slope_rad=attitude.slope, leg_turn_rad=attitude.turn)


def _rows(limits: Sequence[np.ndarray | float], n: int) -> np.ndarray:
    """Limits of checks for n joints, (checks, n)."""
    return np.array([np.broadcast_to(limit, n) for limit in limits]).reshape(len(limits), n)
