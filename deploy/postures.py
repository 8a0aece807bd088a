"""Standing up, lying down, unfolding after a fall: joint commands on the way to a posture."""

from enum import Enum, auto

import numpy as np

from footfall.deploy.clearance import Clearance
from footfall.deploy.config import DeployConfig
from footfall.deploy.levelling import Levelling
from footfall.deploy.modes import DECIDING, MOVING, Mode
from footfall.deploy.pose_path import PosePath
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.readings import Sensed

SOFT = 0.3  # share of the stiffness for unfolding; with all of it the limbs hit the ground harder
MOVING_SHARE = 0.7  # smallest share of the time to stand up that is motion; the rest is for settling


class MotionBefore(Enum):
    """Motion of the robot before it lies down."""

    STANDING = auto()  # on all feet
    STOPPED = auto()  # possibly with a foot in the air
    WALKING = auto()  # at any speed

    @staticmethod
    def of(mode: Mode, faulty: bool) -> "MotionBefore":
        """Motion before the robot lies down from a mode: without a fault it has stopped first."""
        if mode is Mode.STANDING:
            return MotionBefore.STANDING
        return MotionBefore.WALKING if faulty else MotionBefore.STOPPED


class Postures:
    """Joint targets while the robot stands up, lies down or unfolds. Times count from the start of each."""

    def __init__(self, robot: Robot, config: DeployConfig, lie_down: bool, stand_up: bool = True) -> None:
        """`lie_down`: whether the robot may lie down, if it can. Without `stand_up` it holds its initial
        pose."""
        self._config, self._stands = config, stand_up
        self._held_start = robot.description.held_start
        self._standing, self._lying = robot.default_pose, robot.lying_pose
        self.may_lie = lie_down and self._lying is not None
        self._clearance = Clearance(robot)
        self._levelling, self._levelling_active = Levelling(robot, config.levelling), False
        limit = robot.description.target_rate_rad_s
        self._rate = min(config.pose_rate_rad_s, limit)
        # Share of the path from standing (0) to lying (1) that comes first, and its rate in rad/s. After
        # stopping, raised feet are put down first. While walking the base is lowered first, or the robot
        # pitches over.
        self._first_segment = {
            MotionBefore.STOPPED: (0.0, min(config.stop_rate_rad_s, limit)),
            MotionBefore.WALKING: (config.sink_share, min(config.sink_rate_rad_s, limit)),
        }
        self._zeros = np.zeros(len(robot.joint_names))
        self._stiff = config.stand_kp_scale * robot.kp, config.stand_kd_scale * robot.kd
        self._soft = SOFT * robot.kp, SOFT**0.5 * robot.kd  # the same damping ratio
        self._gains = self._stiff
        self._max_rate = limit
        self._path = PosePath([self._standing], [])
        self._legs_carry_from_s = 0.0  # time from which the legs should carry the base

    def stand_up(self, joint_position: np.ndarray, quaternion: np.ndarray) -> None:
        """Start the path to the default pose; a lying robot folds its legs first.

        Args:
            joint_position: joint positions, rad, (n,).
            quaternion: orientation of the base, w x y z.
        """
        self._gains, self._levelling_active = self._stiff, self._stands
        if not self._stands:
            self._path = PosePath(
                [joint_position, joint_position], [self._rate], MOVING_SHARE * self._config.stand_s
            )
            return
        min_share = self._config.safety.sensors.sunk  # a base that sank this far lies on the ground
        lies = self._lying is not None and self._clearance.sunk_share(joint_position, quaternion) >= min_share
        poses = [joint_position, self._standing]
        if lies and self._lying is not None:
            poses.insert(1, self._lying)
        min_s = MOVING_SHARE * self._config.stand_s
        self._path = PosePath(poses, [self._rate] * (len(poses) - 1), min_s)
        self._legs_carry_from_s = self._path.duration_s if lies else 0.0

    def lie_down(self, target: np.ndarray, before: MotionBefore) -> None:
        """Start the path to the lying pose, if the robot has one.

        Args:
            target: last position targets, rad, (n,).
            before: motion of the robot until now.
        """
        if self._lying is None:
            return
        self._gains, self._levelling_active = self._stiff, False
        poses, rates = [target, self._lying], [self._rate]
        if before in self._first_segment:
            share, rate = self._first_segment[before]
            poses.insert(1, self._standing + share * (self._lying - self._standing))
            rates.insert(0, rate)
        self._path = PosePath(poses, rates)
        self._legs_carry_from_s = float("inf")

    def unfold(self, joint_position: np.ndarray) -> None:
        """Start the path of a fallen robot to the default pose, in any position of its base.

        Crossed limbs, or a thigh under the trunk, would block a get-up policy.

        Args:
            joint_position: joint positions, rad, (n,).
        """
        self._gains, self._levelling_active = self._soft, False
        min_s = MOVING_SHARE * self._config.safety.recovery.unfold_s
        self._path = PosePath([joint_position, self._standing], [self._max_rate], min_s)

    def unfolded(self, time_s: float) -> bool:
        """Whether the time for unfolding is over."""
        return time_s >= self._config.safety.recovery.unfold_s - 1e-9

    def command(self, time_s: float, sensed: Sensed | None = None) -> JointCommand:
        """Joint command at this time; with readings, a biped that stands up is levelled."""
        command = JointCommand(self._path.at(time_s), self._zeros, *self._gains, self._zeros)
        if sensed is None or not self._levelling_active:
            return command
        return self._levelling.applied(command, time_s - self._legs_carry_from_s, sensed)

    def done(self, time_s: float) -> bool:
        """Whether the pose is reached, and the robot has settled in it."""
        hold_s = (1.0 - MOVING_SHARE) * self._config.stand_s
        return time_s >= self._path.duration_s + hold_s - 1e-9

    def held_up(self, time_s: float, mode: Mode) -> bool:
        """Whether a person holds the robot, `time_s` after the start of the mode."""
        walks = mode is Mode.WALKING and time_s >= self._config.in_place_s
        return self._held_start and mode in (Mode.CHECKING, *MOVING) and not walks

    def on_legs(self, time_s: float, mode: Mode) -> bool:
        """Whether the legs should carry the base; the policy takes control once they do."""
        legs_carry = mode in DECIDING or time_s >= self._legs_carry_from_s
        return self._stands and legs_carry and not self.held_up(time_s, mode)
