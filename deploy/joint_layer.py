"""Joint layer between policies and motors: limits and encodes commands, and decodes readings."""

import numpy as np

from footfall.common.arrays import any_nonzero, clamped
from footfall.deploy.battery import NO_BATTERY, BatteryMonitor, BatteryState
from footfall.deploy.drivers.driver import Driver, damping_alone
from footfall.deploy.drivers.foot_force import FootForceReader
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.drivers.imu_driver import ImuDriver
from footfall.deploy.frames import Frames
from footfall.deploy.receiver import LastArrivals, MotorHealth, Receiver
from footfall.policies.policy import Sensed
from footfall.robots.actuator import JointCommand, Motor, limit_torque, pd_torque, weaker
from footfall.robots.description import Robot
from footfall.robots.targets import approach
from footfall.robots.winding import at_temperature

MAX_TORQUES = 100  # number of commands whose torques are kept for `take_torques`


class JointLayer:
    """Soft position limits, target rate limit and torque clamp for commands; latest readings."""

    def __init__(
        self,
        robot: Robot,
        driver: Driver,
        imu: ImuDriver,
        tick_s: float,
        scale: float = 1.0,
        battery: BatteryMonitor | None = None,
        feet: FootForceReader | None = None,
    ) -> None:
        """Targets start at the default pose.

        Args:
            robot: robot with soft limits, target rate and motors.
            driver: driver of all motors.
            imu: driver of the IMU.
            tick_s: time between two commands.
            scale: factor of a command's stiffness, damping and torque, and of each motor's torque limit.
                `damping` is never scaled.
            battery: also limits the motors' torque; None for none.
            feet: reader of the force sensors; None for a robot without them.
        """
        self._scale, self._weaker = scale, weaker(robot.motor, scale)
        self._robot, self._driver, self._battery = robot, driver, battery
        self._receiver = Receiver(driver, imu, len(robot.joint_names), feet)
        self._step = robot.description.target_rate_rad_s * tick_s  # largest change of a target per tick, rad
        self._lower, self._upper = robot.soft_limits
        self._target = robot.default_pose.copy()
        self._requested_key = b""  # bytes of the last requested command, from which these are computed:
        self._goal = self._target  # its position target within the soft limits
        self._arrived = False  # whether the target has reached the goal
        self._encodable = np.zeros((5, len(self._target)))  # within frames' ranges, with this tick's target
        self.sent = np.zeros_like(self._encodable)  # last command, before rounding in a frame
        self.sent_before = self.sent  # the command before
        self._possible_torque = np.zeros(len(self._target))  # torque of the last command, N m
        self._torques: list[np.ndarray] = []  # torques of the commands since `take_torques`

    # -- out -----------------------------------------------------------------------------------------

    def begin_at(self, position: np.ndarray) -> None:
        """Start the targets at joint positions, rad, (n,), clamped to the soft limits."""
        lowest, highest = self._driver.lowest[0], self._driver.highest[0]
        self._lower, self._upper = (limit.clip(lowest, highest) for limit in self._robot.soft_limits)
        self._target = position.clip(self._lower, self._upper)
        self._requested_key = b""

    @property
    def target(self) -> np.ndarray:
        """Last position targets, rad, (n,)."""
        return self._target

    @property
    def stiffness(self) -> np.ndarray:
        """Stiffness of the last command, N m/rad, (n,)."""
        return self.sent[2]

    def command(self, requested: JointCommand | np.ndarray) -> Frames:
        """Frames of one tick for a requested command with finite numbers.

        An array (5, n) has the command's parts as rows, which saves joining them.

        The position target stays inside the soft limits and moves no faster than the robot's target rate.
        If the PD law would exceed a motor's limits at the measured position and speed, stiffness, damping and
        feed-forward torque are reduced together.
        """
        values = np.asarray(requested, dtype=float)
        key = values.tobytes()
        if key != self._requested_key:  # a policy's command is repeated for several ticks
            self._requested_key, self._encodable = key, self._within_frames(values)
            if self._scale != 1.0:
                self._encodable[2:] *= self._scale
            self._goal = clamped(values[0], self._lower, self._upper)
            self._arrived = False
        if not self._arrived:
            self._target = approach(self._goal, self._target, self._step)
            self._encodable = self._encodable.copy()
            self._encodable[0] = self._target
            self._arrived = not any_nonzero(self._target != self._goal)
        frames = self._send(self._clamped(self._encodable, self._weaker))
        self._torques.append(self._possible_torque)
        if len(self._torques) >= MAX_TORQUES:
            self._torques = [np.minimum.reduce(self._torques), np.maximum.reduce(self._torques)]
        return frames

    def take_torques(self) -> list[np.ndarray]:
        """Torques of the commands since the last call, N m, (n,) each; of the last one if there was none.

        Of more than `MAX_TORQUES` commands, only the smallest and the largest torques.
        """
        torques, self._torques = self._torques or [self._possible_torque], []
        return torques

    def damping(self, kd: float) -> Frames:
        """Frames that only damp the joints, kd in N m s/rad, within the motors' limits."""
        self._target, self._arrived = self._receiver.joints[0].copy(), False
        return self._send(self._damping(kd))

    def possible_damping(self, kd: float) -> np.ndarray:
        """Largest damping up to kd, N m s/rad, that exceeds no motor's limit at its speed, (n,)."""
        return self._damping(kd)[3]

    def _damping(self, kd: float) -> np.ndarray:
        values = damping_alone(np.full(len(self._target), kd))
        return self._clamped(self._within_frames(values), self._robot.motor)

    def _within_frames(self, values: np.ndarray) -> np.ndarray:
        """A command (5, n) clamped to the frames' ranges, so that the predicted torque matches the frames."""
        return clamped(values, self._driver.lowest, self._driver.highest)

    def _clamped(self, values: np.ndarray, motor: Motor) -> np.ndarray:
        """A command (5, n) within every motor's torque limits, with all gains of a joint reduced equally."""
        joints = self._receiver.joints
        position, velocity = joints[0], joints[1]
        demand = pd_torque(JointCommand.of(values), position, velocity)
        self._possible_torque = possible_torque = limit_torque(demand, velocity, motor)
        if any_nonzero(demand != possible_torque):
            share = _share(possible_torque, demand)
            values = values.copy()
            values[2:] *= share
            # Rounding up an accelerating gain would exceed the limit: the position error may be many radians.
            accelerates = (share < 1.0) & (demand * (values[:2] - joints[:2]) > 0.0)
            values[2:4] -= accelerates * self._driver.gain_rounding
            np.maximum(values[2:4], self._driver.lowest[2:4], out=values[2:4])
        return values

    def _send(self, values: np.ndarray) -> Frames:
        """Frames for a command (5, n)."""
        self.sent_before, self.sent = self.sent, values
        return self._driver.command(values)

    # -- in ------------------------------------------------------------------------------------------

    def absorb(self, batches: list[Frames], now_us: int) -> None:
        """Decode received frames; frames of other senders are ignored."""
        receiver, battery = self._receiver, self._battery
        receiver.absorb(batches, now_us)
        battery_updated = battery is not None and battery.update(
            now_us, receiver.voltage, receiver.current, receiver.joints
        )
        if battery_updated or self._robot.winding is not None:
            self._weaker = self._limited_motor()

    def _limited_motor(self) -> Motor:
        """Motors with the torque limits of this run, the battery and their reported temperatures."""
        allowed_by_battery = 1.0 if self._battery is None else self._battery.state.allowed
        motor = weaker(self._robot.motor, self._scale * allowed_by_battery)
        return at_temperature(motor, self._receiver.temperature_c, self._robot.winding)

    def sensed(self) -> Sensed:
        """Latest readings; the arrays do not change afterwards."""
        return self._receiver.sensed()

    @property
    def joints(self) -> np.ndarray:
        """Latest position rad, velocity rad/s and torque N m of the joints, (3, n)."""
        return self._receiver.joints

    @property
    def torque_share(self) -> np.ndarray:
        """Latest reported torques relative to the motors' peak torques, absolute values, (n,)."""
        share: np.ndarray = np.abs(self._receiver.joints[2]) / self._robot.motor.peak_torque
        return share

    @property
    def temperature_c(self) -> np.ndarray:
        """Latest temperatures, (n,); NaN if not reported."""
        return self._receiver.temperature_c

    @property
    def voltage(self) -> np.ndarray:
        """Latest voltages, V, (n,); NaN if not reported."""
        return self._receiver.voltage

    @property
    def battery(self) -> BatteryState:
        """State of the battery."""
        return NO_BATTERY if self._battery is None else self._battery.state

    @property
    def inertial(self) -> Inertial:
        """Latest reading of the IMU."""
        return self._receiver.inertial

    @property
    def oldest_of_imu(self) -> str:
        """Name of the oldest part of the IMU's reading."""
        return self._receiver.oldest_of_imu

    @property
    def replies(self) -> np.ndarray:
        """Number of replies of each motor so far, (n,)."""
        return self._receiver.replies

    @property
    def imu_older(self) -> int:
        """Number of the IMU's frames so far that were older than its latest reading."""
        return self._receiver.imu_older

    @property
    def imu_damaged(self) -> int:
        """Number of the IMU's messages so far that were ignored because of a wrong checksum."""
        return self._receiver.imu_damaged

    def last_arrivals(self) -> LastArrivals:
        """Arrival times of the latest readings."""
        return self._receiver.last_arrivals()

    def health(self, now_us: int) -> MotorHealth:
        """Age of the latest readings and state of the motors; the arrays do not change afterwards."""
        return self._receiver.health(now_us)


def _share(possible: np.ndarray, demand: np.ndarray) -> np.ndarray:
    """Possible share of a commanded torque, (n,), 0 to 1.

    0 if a motor above its no-load speed can only brake, and the command accelerates.
    """
    share = (possible == demand).astype(float)
    np.divide(possible, demand, out=share, where=np.abs(possible) < np.abs(demand))
    return share.clip(0.0, 1.0)
