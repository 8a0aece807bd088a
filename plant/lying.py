"""Tests whether a robot stands up and lies down again in simulation, and searches for a lying pose.

The search folds the legs: the feet rise to the base's underside, at positions around their default ones. Of
the poses in which the robot rests on its base under the joint law, those with the least motor effort are
tested over the simulated bus, from lying to standing and back.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import mujoco
import numpy as np

from footfall.common.rotations import rotation_matrix, tilt
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.wiring import wiring_of
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.standing import HoldDefaultPose
from footfall.plant.wires import SimulatedWires
from footfall.robots.actuator import JointCommand, joint_torque
from footfall.robots.checks import LYING_SHARE
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses

# Displacements of the feet over the distance that the base sinks: outwards; and ahead, or fore and aft.
OUTWARD, AHEAD = (0.0, 0.3, 0.6, 0.9), ((0.0, False), *product((-0.4, 0.4), (False, True)))
MAX_CANDIDATES = 3  # largest number of poses tested over the bus
REST_S = 0.6
MAX_TILT_RAD = 0.25
STANDING_SHARE = 0.85  # of the standing height
LIMIT_MARGIN_RAD = 1e-4  # to the soft limits, so that rounding does not exceed them
STAND_S = 0.5
CHECK_PERIOD_US = 20_000


@dataclass(frozen=True)
class LyingResult:
    """Result of standing up from a lying pose and lying down again."""

    trouble: str  # reason of the failure; empty on success
    clearance_m: float  # height of the base's lowest corner above the ground at the end
    tilt_rad: float  # largest tilt


def lying_test(robot: Robot, seed: int = 0, config: DeployConfig | None = None) -> LyingResult:
    """Let a lying robot stand up, hold its default pose, and lie down.

    Args:
        robot: a robot with a lying pose.
        seed: seed of the simulation.
        config: settings of the control loop; None: the robot's own.

    Raises:
        UserError: the robot has no lying pose, or no driver for its motors.
    """
    recorder = _PoseRecorder(robot)
    episode = Episode(lambda _: np.zeros(3), STAND_S, seed, lying=True, lie_down=True, config=config)
    trace = run_episode(robot, HoldDefaultPose(robot), episode, recorder)
    trouble = trace.fall_reason or "; ".join(trace.faults)
    if not trouble and trace.base_position[-1, 2] < STANDING_SHARE * robot.description.standing_height_m:
        trouble = f"it stands {trace.base_position[-1, 2]:.3f} m high only"
    if not trouble and recorder.clearance_m > _max_clearance_m(robot):
        trouble = f"its base stays {recorder.clearance_m:.3f} m above the ground"
    if not trouble and recorder.tilt_rad > MAX_TILT_RAD:
        trouble = f"it tilts by {np.degrees(recorder.tilt_rad):.0f} degrees"
    return LyingResult(trouble, recorder.clearance_m, recorder.tilt_rad)


def find_lying_pose(robot: Robot, config: DeployConfig | None = None) -> np.ndarray | None:
    """A lying pose, rad, (n,), from which the robot stands up and to which it returns.

    Returns:
        None if none of the tested poses works.
    """
    poses = list(_folded(robot))
    efforts = [resting_effort(robot, pose) for pose in poses]
    candidates = [poses[index] for index in np.argsort(efforts)[:MAX_CANDIDATES] if efforts[index] < 1.0]
    return next(
        (pose for pose in candidates if not lying_test(_lying_in(robot, pose), config=config).trouble), None
    )


class _PoseRecorder:
    """Records the base's clearance and tilt."""

    def __init__(self, robot: Robot) -> None:
        self._corners = robot.legs.base_corners
        self.clearance_m = self.tilt_rad = 0.0

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.now_us % CHECK_PERIOD_US:
            return
        truth = body.truth()
        self.clearance_m = _clearance(self._corners, truth.base_position, truth.base_quaternion)
        if loop.state.mode is not Mode.IDLE:
            self.tilt_rad = max(self.tilt_rad, float(tilt(truth.base_quaternion)))


def _max_clearance_m(robot: Robot) -> float:
    return LYING_SHARE * robot.description.standing_height_m


def _clearance(corners: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> float:
    """Height of a base's lowest corner, m."""
    return float((corners @ rotation_matrix(quaternion)[2]).min() + position[2])


def _folded(robot: Robot) -> Iterator[np.ndarray]:
    """Poses (n,) with the feet as low as the base, within the soft limits, rad."""
    legs = robot.legs
    sink_m = robot.description.standing_height_m - legs.base_below
    lower, upper = robot.soft_limits
    stand = legs.default_foot
    side_sign, fore_sign = np.sign(stand[:, 1]), np.sign(stand[:, 0] - stand[:, 0].mean())
    for outward, (ahead, fore_and_aft) in product(OUTWARD, AHEAD):
        foot = stand.copy()
        foot[:, 0] += ahead * sink_m * (fore_sign if fore_and_aft else 1.0)
        foot[:, 1] += outward * sink_m * side_sign
        foot[:, 2] = legs.foot_radius - legs.base_below
        pose = legs.scatter(legs.solve(foot), robot.default_pose).clip(
            lower + LIMIT_MARGIN_RAD, upper - LIMIT_MARGIN_RAD
        )
        feet_m = (legs.pose(pose).foot[:, 2] - legs.foot_radius).min()
        if -legs.base_below - feet_m <= _max_clearance_m(robot):
            yield pose.round(4)


def resting_effort(robot: Robot, pose: np.ndarray) -> float:
    """Largest joint torque over peak torque at rest in a pose; infinite if the robot does not rest in it."""
    wiring = wiring_of(robot)
    wires = SimulatedWires(wiring.buses)
    body = SimulatedRobot(_lying_in(robot, pose), wiring, wires, PlantConfig(lying=True))
    model, data = body.model, body.data
    if any((model.geom_bodyid[contact] > 0).all() for contact in data.contact.geom):
        return np.inf  # links collide
    config, (qpos_addresses, dofs), zero = (
        deploy_config(robot),
        joint_addresses(model, robot),
        np.zeros(len(pose)),
    )
    command = JointCommand(
        pose, zero, config.stand_kp_scale * robot.kp, config.stand_kd_scale * robot.kd, zero
    )
    for _ in range(round(REST_S / model.opt.timestep)):
        torque = joint_torque(command, data.qpos[qpos_addresses], data.qvel[dofs], robot.motor)
        data.qfrc_applied[dofs] = torque
        mujoco.mj_step(model, data)
    truth = body.truth()
    clearance_m = _clearance(robot.legs.base_corners, truth.base_position, truth.base_quaternion)
    if clearance_m > _max_clearance_m(robot) or tilt(truth.base_quaternion) > MAX_TILT_RAD:
        return np.inf
    return float((np.abs(torque) / robot.motor.peak_torque).max())


def _lying_in(robot: Robot, pose: np.ndarray) -> Robot:
    """The robot with another lying pose."""
    description = robot.description
    joints = [
        replace(each, lying_rad=angle) for each, angle in zip(description.joints, pose.tolist(), strict=True)
    ]
    return replace(robot, description=replace(description, joints=tuple(joints)))
