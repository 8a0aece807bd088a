"""A trot from a clock, a cycloid and inverse kinematics, balanced by the IMU alone."""

from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_not_negative, require_positive
from footfall.common.rotations import cross
from footfall.policies.controllers.command import CommandShaping, ShapedCommand
from footfall.policies.controllers.gait import GaitConfig, contact_trust, swing_curve
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import level_feet, nominal_feet, tilt_correction
from footfall.policies.policy import Observation
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import LegPose


@dataclass(frozen=True)
class TrotConfig:
    """Gait and gains of `Trot`."""

    rate_hz: float
    gait: GaitConfig
    command: CommandShaping
    height_m: float  # base above the ground
    stance_outward_m: float  # of each foot, from its place in the default pose away from the middle
    stance_shift_m: float  # of all feet, forward
    swing_height_m: float
    kp: float  # N m/rad
    kd: float  # N m s/rad
    tilt_gain: float  # share of the measured tilt that the legs counter
    tilt_rate_gain_s: float
    tilt_filter_s: float  # time constant: the feet's velocity must not carry the gyro's noise
    most_tilt_rad: float
    weight_n: float  # carried by the legs in stance, as feed-forward torque
    most_step_m: float  # farthest that a foot lands from its place under the hip
    settle_s: float  # time to move from the pose found at reset to the stance

    def __post_init__(self) -> None:
        require_positive(self, "rate_hz", "height_m", "kp", "tilt_filter_s", "settle_s")
        require_not_negative(self, "kd", "tilt_gain", "tilt_rate_gain_s", "most_tilt_rad")
        require_not_negative(self, "swing_height_m", "weight_n", "most_step_m")


class Trot:
    """Position control of all joints: feet sweep back in stance at the commanded velocity."""

    name = "trot"
    needs_estimate = False
    contract = None
    notes = ()

    def __init__(self, robot: Robot, config: TrotConfig | None = None) -> None:
        self._config = config or controller_settings(robot, self.name, TrotConfig)
        self.rate_hz = self._config.rate_hz
        self._robot = robot
        self._legs = robot.legs
        self._clock = self._config.gait.clock(robot)
        self._command = ShapedCommand(self._config.command)
        self._place = nominal_feet(
            self._legs,
            self._config.height_m,
            self._config.stance_outward_m,
            self._config.stance_shift_m,
        )
        self._start = robot.default_pose
        self._previous = robot.default_pose
        self._tilt = np.zeros(2)
        self._kp = np.full(len(robot.joint_names), self._config.kp)
        self._kd = np.full(len(robot.joint_names), self._config.kd)

    def reset(self, observation: Observation) -> None:
        self._clock.reset()
        self._command.reset()
        self._start = observation.sensed.joint_position.copy()
        self._previous = self._start
        self._tilt = np.zeros(2)

    def act(self, observation: Observation) -> JointCommand:
        config, dt_s = self._config, 1.0 / self.rate_hz
        settled = observation.time_s >= config.settle_s
        if settled:
            self._command.advance(observation.command, dt_s)
        walk = settled and self._command.wants_walk(observation.command)
        self._clock.advance(dt_s, walk)

        tilt = tilt_correction(observation, config.tilt_gain, config.tilt_rate_gain_s, config.most_tilt_rad)
        self._tilt += min(1.0, dt_s / config.tilt_filter_s) * (tilt - self._tilt)
        feet = level_feet(self._place + self._step(), self._tilt)
        goal = self._legs.scatter(self._legs.solve(feet), self._robot.default_pose)
        share = min(1.0, observation.time_s / config.settle_s)
        position = self._start + share * (goal - self._start)
        velocity = (position - self._previous) / dt_s
        self._previous = position

        pose = self._legs.pose(observation.sensed.joint_position)
        torque = self._legs.scatter(self._weight_torque(pose), np.zeros_like(position))
        return JointCommand(position, velocity, self._kp, self._kd, torque)

    def stance(self) -> np.ndarray | None:
        if not self._clock.walking:
            return np.ones(self._legs.count)
        return contact_trust(self._clock.phases(), self._clock.timing.duty, edge=0.2)

    def _step(self) -> np.ndarray:
        """Offset of each foot (legs, 3) from its place, m: sweep in stance, cycloid in swing."""
        config = self._config
        half = 0.5 * self._clock.timing.stance_s * self._foot_velocity()
        half = np.minimum(np.maximum(half, -config.most_step_m), config.most_step_m)
        if not self._clock.walking:
            return np.zeros_like(self._place)
        through_stance = np.minimum(self._clock.phases() / self._clock.timing.duty, 1.0)
        swing = self._clock.swing()
        stands = self._clock.stance()
        curves = [swing_curve(progress) for progress in swing.tolist()]
        along = np.array([curve.along.value for curve in curves])
        sweep = np.where(stands, 1.0 - 2.0 * through_stance, 2.0 * along - 1.0)
        offset = sweep[:, None] * half
        offset[:, 2] = config.swing_height_m * np.array([curve.height.value for curve in curves])
        return offset

    def _foot_velocity(self) -> np.ndarray:
        """How fast the base should pass over each foot, (legs, 3) m/s."""
        forward, leftward, yaw_rate = self._command.value
        turning = cross(np.array([0.0, 0.0, yaw_rate]), self._place)
        return turning + np.array([forward, leftward, 0.0])

    def _weight_torque(self, pose: LegPose) -> np.ndarray:
        """Joint torques (legs, m) that share the weight among the feet that stand, N m."""
        stands = self._clock.stance()
        force = np.zeros_like(pose.foot)
        force[:, 2] = stands * (self._config.weight_n / max(1, int(stands.sum())))
        return self._legs.torque(pose.jacobian, force)
