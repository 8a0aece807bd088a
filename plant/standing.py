"""Tests whether a robot stands: it holds its default pose over the simulated bus."""

from dataclasses import dataclass

import numpy as np

from footfall.common.rotations import tilt
from footfall.plant.episode import Episode, run_episode
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

MEASURED_SHARE = 0.5  # torques and contacts are measured over this last share of the test


class HoldDefaultPose:
    """Commands the default pose with the robot's own gains."""

    name = "hold-default-pose"
    rate_hz = 50.0
    needs_estimate = False
    notes = ()
    contract = None

    def __init__(self, robot: Robot) -> None:
        zero = np.zeros(len(robot.joint_names))
        self._command = JointCommand(robot.default_pose, zero, robot.kp, robot.kd, zero)

    def reset(self, inputs: PolicyInput) -> None:
        """Does nothing: the policy has no state."""

    def act(self, inputs: PolicyInput) -> JointCommand:
        return self._command

    def stance(self) -> np.ndarray | None:
        return None


@dataclass(frozen=True)
class StandingResult:
    """Result of a standing test."""

    fall_reason: str  # empty if the robot did not fall
    faults: tuple[str, ...]  # of the deploy loop
    stood_s: float
    sank_m: float  # largest distance of the base below its standing height
    tilt_rad: float  # largest tilt of the base
    moved_m: float  # largest horizontal distance of the base from its start
    torque_share: np.ndarray  # (n,) largest share of the peak torque once settled
    feet_down: np.ndarray  # (feet,) share of the time in contact once settled

    @property
    def stood(self) -> bool:
        """Whether the robot stood until the end without a fault."""
        return not self.fall_reason and not self.faults


def standing_test(robot: Robot, duration_s: float = 4.0, seed: int = 0) -> StandingResult:
    """Let a robot hold its default pose in simulation.

    Raises:
        UserError: there is no driver for its motors.
    """
    episode = Episode(command_source=lambda _: np.zeros(3), duration_s=duration_s, seed=seed)
    trace = run_episode(robot, HoldDefaultPose(robot), episode)
    settled = slice(int(len(trace.time_s) * (1 - MEASURED_SHARE)), None)
    position, contact = trace.base_position, trace.foot_contact[settled]
    torque = np.abs(trace.motor_torque[settled]) / robot.motor.peak_torque
    height = robot.description.standing_height_m
    return StandingResult(
        fall_reason=trace.fall_reason or ("the simulation diverged" if trace.fell else ""),
        faults=trace.faults,
        stood_s=trace.walked_s,
        sank_m=float(np.max(height - position[:, 2], initial=0.0)),
        tilt_rad=float(max((tilt(q) for q in trace.base_quaternion), default=0.0)),
        moved_m=float(np.linalg.norm((position - position[:1])[:, :2], axis=1).max(initial=0.0)),
        torque_share=torque.max(axis=0, initial=0.0),
        feet_down=contact.mean(axis=0) if len(contact) else np.zeros(contact.shape[1]),
    )
