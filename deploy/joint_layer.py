"""Between policies and motors: limits what goes out, turns it into frames, and frames into readings."""

from typing import NamedTuple

import numpy as np

from footfall.deploy.drivers import imu
from footfall.deploy.drivers.driver import Driver, damping_alone
from footfall.deploy.drivers.imu import ImuReader, Inertial
from footfall.deploy.frames import Frames, same_layout
from footfall.policies.policy import Sensed
from footfall.robots.actuator import JointCommand, Motor, limit_torque, pd_torque, weaker
from footfall.robots.description import Robot
from footfall.robots.targets import approach, within

NEVER = -(10**15)  # microseconds: long ago


class LastHeard(NamedTuple):
    """When the robot was last heard, in microseconds of the loop's clock, and what its motors reported."""

    motor_us: np.ndarray  # (n,)
    imu_us: int  # the part of the IMU that was renewed longest ago
    motor_error: np.ndarray  # (n,) error codes


class MotorHealth(NamedTuple):
    """How old the latest readings are, and what n motors say of their own state."""

    age_s: np.ndarray  # (n + 1,) since each motor's reading arrived, and the oldest part of the IMU's
    temperature_c: np.ndarray  # (n,) NaN where a motor does not say
    voltage: np.ndarray  # (n,) likewise
    error: np.ndarray  # (n,) codes, 0 for none


class BatchSplit:
    """Splits batches of one layout into the IMU's frames and the motors', in the same arrays each time."""

    def __init__(self, frames: Frames) -> None:
        from_imu = (frames.id >= imu.IDS[0]) & (frames.id <= imu.IDS[-1])
        self._whole = frames
        self._rows = np.flatnonzero(from_imu), np.flatnonzero(~from_imu)
        self._parts = tuple(frames.take(rows) for rows in self._rows)

    def is_of(self, frames: Frames) -> bool:
        """Whether a batch has this very layout."""
        return same_layout(frames, self._whole)

    def parts(self, frames: Frames) -> list[Frames]:
        """The IMU's frames and the motors'."""
        when = frames.time_us
        return [
            Frames(
                part.channel, part.id, frames.data[rows], part.length, None if when is None else when[rows]
            )
            for part, rows in zip(self._parts, self._rows, strict=True)
        ]


class JointLayer:
    """Soft position limits, target rate limit and torque clamp on the way out; readings on the way in."""

    def __init__(
        self, robot: Robot, driver: Driver, imu_channel: int, tick_s: float, scale: float = 1.0
    ) -> None:
        """`imu_channel` is the bus that the IMU is on, `tick_s` the time between two commands.

        `scale` is the share of a command's stiffness, damping and torque, and of each motor's torque, that is
        let through; damping is always whole.
        """
        self._scale, self._weaker = scale, weaker(robot.motor, scale)
        self._robot, self._driver = robot, driver
        self._step = robot.description.target_rate_rad_s * tick_s  # of a target in one tick, rad
        self._lower, self._upper = robot.soft_limits
        n = len(robot.joint_names)
        self._target = robot.default_pose.copy()
        self._wanted: JointCommand | np.ndarray | None = None  # the decision that these are of:
        self._goal = self._target  # where its target leads
        self._arrived = False  # whether the target is there
        self._sayable = np.zeros((5, n))  # what frames can say of it, with the target of this tick
        self._joints = np.zeros((3, n))
        self._imu = ImuReader(imu_channel)
        # Arrays of ids that came last from motors alone and from the IMU alone: a simulated bus hands out the
        # same ones again and again, which saves looking into them.
        self._reply_ids: np.ndarray | None = None
        self._imu_ids: np.ndarray | None = None
        self._split: BatchSplit | None = None  # likewise, of both
        self._motor_us = np.full(n, NEVER)
        self._error = np.zeros(n, dtype=np.uint8)
        self._absorbed_us = NEVER  # when replies were taken in last
        self.temperature_c = np.full(n, np.nan)  # as last told; NaN where a motor does not say
        self.voltage = np.full(n, np.nan)  # likewise, V
        self.stiffness = np.zeros(n)  # that the last frames carried, N m/rad
        self.sent = np.zeros((5, n))  # all that they carried, before a frame rounds it
        self._sent_before = self.sent  # likewise, of the frames before

    # -- out -----------------------------------------------------------------------------------------

    def begin_at(self, position: np.ndarray) -> None:
        """Let targets start from these joint positions, rad, (n,), or from the soft limits next to them."""
        lowest, highest = self._driver.lowest[0], self._driver.highest[0]
        self._lower, self._upper = (limit.clip(lowest, highest) for limit in self._robot.soft_limits)
        self._target = position.clip(self._lower, self._upper)
        self._wanted = None

    @property
    def target(self) -> np.ndarray:
        """Position targets that went out last, rad, (n,)."""
        return self._target

    def command(self, wanted: JointCommand | np.ndarray) -> Frames:
        """Frames for one tick of a wanted command with finite numbers, in arrays that nobody writes to.

        An array (5, n) holds the command's parts as its rows, which saves putting them together.

        The position target stays inside the soft limits and moves no faster than the robot's target rate.
        Where the PD law would ask a motor for more than its limits at the measured position and speed,
        stiffness, damping and feed-forward torque are lowered together.
        """
        if wanted is not self._wanted:
            self._wanted, self._sayable = wanted, self._within_frames(np.asarray(wanted, dtype=float))
            if self._scale != 1.0:
                self._sayable[2:] *= self._scale
            self._goal = within(wanted[0], self._lower, self._upper)
            self._arrived = False
        if not self._arrived:
            self._target = approach(self._goal, self._target, self._step)
            self._sayable = self._sayable.copy()
            self._sayable[0] = self._target
            self._arrived = not np.count_nonzero(self._target != self._goal)
        return self._send(self._clamped(self._sayable, self._weaker))

    def damping(self, kd: float) -> Frames:
        """Frames that only damp the joints, kd in N m s/rad, within the motors' limits."""
        self._target, self._arrived = self._joints[0].copy(), False
        return self._send(self._damping(kd))

    def possible_damping(self, kd: float) -> np.ndarray:
        """What of a damping kd, N m s/rad, asks no motor for more than its limit at its speed, (n,)."""
        return self._damping(kd)[3]

    def _damping(self, kd: float) -> np.ndarray:
        values = damping_alone(np.full(len(self._target), kd))
        return self._clamped(self._within_frames(values), self._robot.motor)

    def _within_frames(self, values: np.ndarray) -> np.ndarray:
        """A command (5, n) without what a frame cannot say, since what a motor is asked for depends on it."""
        return within(values, self._driver.lowest, self._driver.highest)

    def _clamped(self, values: np.ndarray, motor: Motor) -> np.ndarray:
        """A command (5, n) that asks no motor for more than it may do, with all its gains lowered alike."""
        position, velocity = self._joints[0], self._joints[1]
        asked = pd_torque(JointCommand.of(values), position, velocity)
        possible = limit_torque(asked, velocity, motor)
        if np.count_nonzero(asked != possible):
            share = _share(possible, asked)
            values = values.copy()
            values[2:] *= share
            # A frame must not round up what pushes too far: many radians of error make that much torque.
            pushes = (share < 1.0) & (asked * (values[:2] - self._joints[:2]) > 0.0)
            values[2:4] -= pushes * self._driver.gain_rounding
            np.maximum(values[2:4], self._driver.lowest[2:4], out=values[2:4])
        return values

    def _send(self, values: np.ndarray) -> Frames:
        """Frames of a command (5, n)."""
        self._sent_before = self.sent
        self.stiffness, self.sent = values[2], values
        return self._driver.command(values)

    # -- in ------------------------------------------------------------------------------------------

    def absorb(self, batches: list[Frames], now_us: int) -> None:
        """Take in frames that have arrived; what is not from this robot is left aside."""
        for frames in batches:
            if frames.id is self._reply_ids:
                self._absorb_replies(frames, now_us)
            elif frames.id is self._imu_ids:
                self._imu.absorb(frames, now_us)
            elif self._split is not None and self._split.is_of(frames):
                self._absorb_split(self._split, frames, now_us)
            else:
                self._sort(frames, now_us)

    def _sort(self, frames: Frames, now_us: int) -> None:
        """A batch whose ids were not seen before."""
        from_imu = (frames.id >= imu.IDS[0]) & (frames.id <= imu.IDS[-1])
        if not from_imu.any():
            self._reply_ids = frames.id
            self._absorb_replies(frames, now_us)
        elif from_imu.all():
            self._imu_ids = frames.id
            self._imu.absorb(frames, now_us)
        else:
            self._split = BatchSplit(frames)
            self._absorb_split(self._split, frames, now_us)

    def _absorb_split(self, split: BatchSplit, frames: Frames, now_us: int) -> None:
        from_imu, from_motors = split.parts(frames)
        self._imu.absorb(from_imu, now_us)
        self._absorb_replies(from_motors, now_us)

    def sensed(self) -> Sensed:
        """The latest readings; the arrays are not written to afterwards."""
        gyro, acceleration, quaternion = self._imu.reading
        position, velocity, torque = self._joints[0], self._joints[1], self._joints[2]
        return Sensed(
            np.array(gyro), np.array(acceleration), np.array(quaternion), position, velocity, torque
        )

    @property
    def joints(self) -> np.ndarray:
        """Position rad, velocity rad/s and torque N m that the motors reported last, (3, n)."""
        return self._joints

    @property
    def inertial(self) -> Inertial:
        """The IMU's latest reading."""
        return self._imu.reading

    @property
    def oldest_of_imu(self) -> str:
        """The part of the IMU's reading that has not been renewed for longest."""
        return self._imu.oldest

    def expected_torque(self) -> np.ndarray:
        """Torque that motors should report with their latest readings, N m, (n,).

        A reply to a command was measured before the command had an effect, another kind of message after:
        this is the smaller of what the last two commands ask for, and 0 where they point apart.
        """
        position, velocity = self._joints[0], self._joints[1]
        last = pd_torque(JointCommand.of(self.sent), position, velocity)
        if self._sent_before is self.sent:  # the same was sent again
            return last
        before = pd_torque(JointCommand.of(self._sent_before), position, velocity)
        least, most = np.minimum(last, before), np.maximum(last, before)
        return np.maximum(least, 0.0) + np.minimum(most, 0.0)

    def last_heard(self) -> LastHeard:
        """When each part was last heard."""
        imu_us = self._imu.heard_us
        return LastHeard(self._motor_us, NEVER if imu_us is None else imu_us, self._error)

    def health(self, now_us: int) -> MotorHealth:
        """Age of the latest readings and state of the motors; the arrays are not written to afterwards."""
        motor_us, imu_us, error = self.last_heard()
        age_us = np.empty(len(motor_us) + 1)
        age_us[:-1], age_us[-1] = now_us - motor_us, now_us - imu_us
        return MotorHealth(1e-6 * age_us, self.temperature_c, self.voltage, error)

    def _absorb_replies(self, frames: Frames, now_us: int) -> None:
        motor, values, error, temperature, voltage, arrived_us = self._driver.replies(frames)
        again = self._absorbed_us == now_us
        before = self._error if again and np.count_nonzero(self._error) else None
        if isinstance(motor, slice):
            self._joints, self._error = values, error
            self.temperature_c, self.voltage = temperature, voltage
        else:
            self._joints = self._joints.copy()
            self.temperature_c, self.voltage = self.temperature_c.copy(), self.voltage.copy()
            self._joints[:, motor] = values
            self.temperature_c[motor], self.voltage[motor] = temperature, voltage
            self._error = self._error.copy()
            self._error[motor] = 0
            np.maximum.at(self._error, motor, error)
        if before is not None:
            self._error = np.maximum(self._error, before)  # it outlives a later reply of the same tick
        self._absorbed_us = now_us
        self._motor_us[motor] = now_us if arrived_us is None else arrived_us


def _share(possible: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """The share of an asked torque that is possible, (n,), 0 to 1.

    None of it where a motor past its no-load speed can only brake, and is asked to push on.
    """
    share = (possible == asked).astype(float)
    np.divide(possible, asked, out=share, where=np.abs(possible) < np.abs(asked))
    return share.clip(0.0, 1.0)
