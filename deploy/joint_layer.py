"""Between minds and motors: limits what goes out, turns it into frames, and frames into readings."""

from typing import NamedTuple

import numpy as np

from footfall.deploy.drivers import imu, mit
from footfall.deploy.frames import Frames
from footfall.deploy.wiring import Wiring
from footfall.policies.policy import Sensed
from footfall.robots.actuator import JointCommand, limit_torque, pd_torque
from footfall.robots.description import Robot
from footfall.robots.targets import limit_target

NEVER = -(10**15)  # microseconds: long ago


class Heard(NamedTuple):
    """When the robot was last heard, in microseconds of the loop's clock."""

    motor_us: np.ndarray  # (n,)
    imu_us: int
    motor_error: np.ndarray  # (n,) error codes


class JointLayer:
    """Soft position limits, target rate limit and torque clamp on the way out; readings on the way in."""

    def __init__(self, robot: Robot, wiring: Wiring, tick_s: float) -> None:
        self._robot, self._wiring, self._tick_s = robot, wiring, tick_s
        self._codec = mit.Codec(wiring.protocols)
        self._lower, self._upper = robot.soft_limits
        n = len(robot.joint_names)
        self._everyone = np.arange(n)
        self._full = np.full(n, 8)
        self._target = robot.default_pose.copy()
        self._joints = np.zeros((3, n))
        self._gyro: tuple[float, ...] = (0.0, 0.0, 0.0)
        self._acceleration: tuple[float, ...] = (0.0, 0.0, 0.0)
        self._quaternion: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
        self._imu_counter = -1
        self._imu_seen: set[int] = set()
        self._motor_us = np.full(n, NEVER)
        self._imu_us = NEVER
        self._error = np.zeros(n, dtype=np.uint8)
        self._usual: Frames | None = None  # a batch of replies that held all motors in joint order

    # -- out -----------------------------------------------------------------------------------------

    def begin_at(self, position: np.ndarray) -> None:
        """Let the rate limit start from these joint positions, rad, (n,)."""
        self._target = position.copy()

    @property
    def target(self) -> np.ndarray:
        """Position targets that went out last, rad, (n,)."""
        return self._target

    def command(self, wanted: JointCommand) -> Frames:
        """Frames for one tick of a wanted command with finite numbers.

        The position target stays inside the soft limits and moves no faster than the robot's target rate. The
        feed-forward torque takes back what the PD law would ask beyond the motor's limits at the measured
        position and speed.
        """
        target = limit_target(
            wanted.position,
            self._target,
            self._lower,
            self._upper,
            self._robot.description.target_rate_rad_s,
            self._tick_s,
        )
        self._target = target
        position, velocity, _ = self._joints
        asked = pd_torque(wanted._replace(position=target), position, velocity)
        excess = asked - limit_torque(asked, velocity, self._robot.motor)
        values = np.array([target, wanted.velocity, wanted.kp, wanted.kd, wanted.torque - excess])
        return self._frames(self._codec.encode(values))

    def damping(self, kd: float) -> Frames:
        """Frames that only damp the joints, kd in N m s/rad."""
        values = np.zeros((5, len(self._everyone)))
        values[3] = kd
        self._target = self._joints[0].copy()
        return self._frames(self._codec.encode(values))

    def switch(self, word: int) -> Frames:
        """One of the special frames (`mit.ENTER`, `mit.EXIT`) for every motor."""
        return self._frames(mit.special(word, len(self._everyone)))

    def _frames(self, data: np.ndarray) -> Frames:
        return Frames(self._wiring.channel, self._wiring.motor_id, data, self._full)

    # -- in ------------------------------------------------------------------------------------------

    def absorb(self, batches: list[Frames], now_us: int) -> None:
        """Take in frames that have arrived; what is not from this robot is left aside."""
        for frames in batches:
            from_imu = frames.id >= imu.GYRO_ID
            if not from_imu.any():
                self._absorb_replies(frames, now_us)
            elif from_imu.all():
                self._absorb_imu(frames, now_us)
            else:
                self._absorb_imu(frames.take(from_imu), now_us)
                self._absorb_replies(frames.take(~from_imu), now_us)

    def sensed(self) -> Sensed:
        """The latest readings; the arrays are not written to afterwards."""
        return Sensed(
            gyro=np.array(self._gyro),
            acceleration=np.array(self._acceleration),
            quaternion=np.array(self._quaternion),
            joint_position=self._joints[0],
            joint_velocity=self._joints[1],
            joint_torque=self._joints[2],
        )

    def heard(self) -> Heard:
        """When each part was last heard."""
        imu_us = self._imu_us if len(self._imu_seen) == len(imu.IDS) else NEVER
        return Heard(self._motor_us, imu_us, self._error)

    def _absorb_replies(self, frames: Frames, now_us: int) -> None:
        sender = mit.reply_motor(frames.data)
        usual = self._usual
        if _same_senders(frames, usual) and np.array_equal(sender, self._wiring.motor_id):
            self._joints, _, self._error = self._codec.decode_replies(frames.data, slice(None))
            self._motor_us[:] = now_us
            return
        motor = self._wiring.lookup[frames.channel, sender]
        identified = (frames.id == mit.SHARED_REPLY_ID) | (frames.id == sender + mit.REPLY_ID)
        usable = (motor >= 0) & identified & (frames.length >= 6)
        if np.array_equal(motor, self._everyone) and usable.all():
            self._usual = frames
        motor = motor[usable]
        values, _, error = self._codec.decode_replies(frames.data[usable], motor)
        self._joints, self._error = self._joints.copy(), self._error.copy()
        self._joints[:, motor] = values
        self._error[motor] = error
        self._motor_us[motor] = now_us

    def _absorb_imu(self, frames: Frames, now_us: int) -> None:
        for identifier, channel, row in zip(
            frames.id.tolist(), frames.channel.tolist(), frames.data, strict=True
        ):
            if channel != self._wiring.imu_channel or identifier not in imu.IDS:
                continue
            data = row.tobytes()
            self._imu_seen.add(identifier)
            if identifier == imu.GYRO_ID:
                self._gyro, counter = imu.decode_gyro(data)
                if counter != self._imu_counter:
                    self._imu_counter, self._imu_us = counter, now_us
            elif identifier == imu.ACCELERATION_ID:
                self._acceleration = imu.decode_acceleration(data)
            else:
                self._quaternion = imu.decode_quaternion(data) or self._quaternion


def _same_senders(frames: Frames, usual: Frames | None) -> bool:
    """Whether a batch has the very arrays of another one but for its data: a cheap, sufficient test."""
    return (
        usual is not None
        and frames.id is usual.id
        and frames.channel is usual.channel
        and frames.length is usual.length
    )
