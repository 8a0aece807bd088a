"""Excitation of a robot's joints: slow triangles, chirps, bursts of feed-forward torque."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from footfall.common.config import require_between
from footfall.common.easing import smooth_rise
from footfall.identify.clearance import clear_share
from footfall.policies.contract import Contract
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, training_model

CLEAR_HZ = 25.0  # rate of the poses that are checked for contacts
GOLDEN = 0.618034  # golden ratio: its multiples give the joints of a leg distinct phases


@dataclass(frozen=True)
class ExcitationConfig:
    """Settings of the excitation. Gains are relative to the robot's own."""

    settle_s: float = 1.0  # from the initial pose to the centre of the motion
    triangle_s: float = 4.0  # duration for each joint of a leg: slow, to identify friction
    chirp_s: float = 15.0  # duration of each chirp
    burst_s: float = 4.0  # duration of torque bursts, which separate strength from stiffness
    amplitude_rad: float = 0.3
    swing_rad: float = 0.4  # amplitude of a slow swing beneath the chirps; smaller near other bodies
    second_amplitude: float = 0.5  # relative to the first, in the second chirp
    lowest_hz: float = 0.2
    highest_hz: float = 8.0
    corner_hz: float = 1.5  # above this, a chirp's amplitude decreases with frequency
    stiffness: tuple[float, float] = (0.5, 1.0)  # in the two chirps
    damping: tuple[float, float] = (0.7, 1.0)  # same
    burst_share: float = 0.04  # relative to each motor's peak torque
    seed: int = 0

    def __post_init__(self) -> None:
        require_between(self, 0.1, 600.0, "settle_s", "triangle_s", "chirp_s", "burst_s")
        require_between(self, 0.01, 1.0, "amplitude_rad", "second_amplitude")
        require_between(self, 0.0, 1.0, "swing_rad")
        require_between(self, 0.05, 40.0, "lowest_hz", "highest_hz", "corner_hz")
        require_between(self, 0.005, 0.5, "burst_share")
        if (len(self.stiffness), len(self.damping)) != (2, 2):
            raise ValueError("stiffness and damping need two values each: one for each chirp")
        if any(not 0.05 <= each <= 3.0 for each in (*self.stiffness, *self.damping)):
            raise ValueError("stiffness and damping must be from 0.05 to 3, as shares of the robot's gains")


class Excitation:
    """A policy that performs the whole excitation, with all legs at once."""

    name = "excitation"
    needs_estimate = False
    contract: Contract | None = None
    notes: Sequence[str] = ()

    def __init__(self, robot: Robot, config: ExcitationConfig, rate_hz: float) -> None:
        """Args: `rate_hz` is the rate of the policy, which may be the rate of the joint ticks."""
        self.rate_hz, self._config, self._robot = rate_hz, config, robot
        n = len(robot.joint_names)
        low, high = robot.soft_limits
        self._middle = robot.default_pose
        room = np.minimum(self._middle - low, high - self._middle)
        self._amplitude = np.minimum(config.amplitude_rad, 0.9 * room)
        self._joint_index = np.zeros(n)  # index of each joint in its leg
        for joints in robot.foot_joints:
            self._joint_index[joints] = np.arange(len(joints))
        self._senses = swing_senses(robot)
        self._max_joints = 1 + int(self._joint_index.max())
        self._swing = np.minimum(config.swing_rad, 0.9 * room - self._amplitude).clip(0.0)
        self._swing *= clear_share(robot, self._chirp_poses)
        self._start = self._middle
        self._signs = np.random.default_rng(config.seed).choice((-1.0, 1.0), size=(4096, n))

    @property
    def duration_s(self) -> float:
        """Duration of the whole motion."""
        config = self._config
        return config.settle_s + self._max_joints * config.triangle_s + 2 * config.chirp_s + config.burst_s

    def reset(self, inputs: PolicyInput) -> None:
        self._start = inputs.sensed.joint_position.copy()

    def stance(self) -> np.ndarray | None:
        return None

    def act(self, inputs: PolicyInput) -> JointCommand:
        config, time_s = self._config, inputs.time_s
        if time_s < config.settle_s:
            share = smooth_rise(time_s, config.settle_s)
            return self._command((1.0 - share) * (self._start - self._middle), second_chirp=True)
        time_s -= config.settle_s
        if time_s < self._max_joints * config.triangle_s:
            return self._command(self._triangle(time_s), second_chirp=True)
        time_s -= self._max_joints * config.triangle_s
        if time_s < 2 * config.chirp_s:
            second_chirp = time_s >= config.chirp_s
            size = config.second_amplitude if second_chirp else 1.0
            chirp = size * self._chirp(time_s % config.chirp_s)
            return self._command(chirp + self._slow_swing(time_s), second_chirp)
        return self._command(np.zeros_like(self._middle), True, self._burst(time_s - 2 * config.chirp_s))

    def _command(
        self, offset: np.ndarray, second_chirp: bool, torque: np.ndarray | None = None
    ) -> JointCommand:
        robot, config, zero = self._robot, self._config, np.zeros_like(self._middle)
        kp, kd = config.stiffness[second_chirp] * robot.kp, config.damping[second_chirp] * robot.kd
        return JointCommand(self._middle + offset, zero, kp, kd, zero if torque is None else torque)

    def _triangle(self, time_s: float) -> np.ndarray:
        """One joint of each leg after the other moves up, down and back at constant speed."""
        share = (time_s / self._config.triangle_s) % 1.0
        wave = 1.0 - abs(4.0 * ((share + 0.25) % 1.0) - 2.0)
        moves = self._joint_index == int(time_s / self._config.triangle_s)
        return self._senses * moves * wave * self._amplitude

    def _chirp(self, time_s: float) -> np.ndarray:
        """A sweep with exponentially increasing frequency, with a different phase for each joint."""
        config = self._config
        growth = math.log(config.highest_hz / config.lowest_hz) / config.chirp_s
        hz = config.lowest_hz * math.exp(growth * time_s)
        turns = (hz - config.lowest_hz) / growth
        fade = min(1.0, time_s / 0.5, (config.chirp_s - time_s) / 0.2)
        phase = GOLDEN * self._joint_index
        wave = np.sin(2.0 * math.pi * (turns + phase))
        return self._senses * self._amplitude * wave * fade * min(1.0, config.corner_hz / hz)

    def _slow_swing(self, time_s: float) -> np.ndarray:
        """Swing over both chirps, since in a single pose a mass and an encoder bias have the same effect.

        The first joint of a leg swings to both sides. The others swing once for each side, in opposite
        senses, so that a leg that moves under the trunk keeps away from it.
        """
        angle = math.pi * time_s / self._config.chirp_s
        once = 0.5 - 0.5 * math.cos(2.0 * angle)
        wave = np.select([self._joint_index == 0, self._joint_index % 2 == 1], [math.sin(angle), -once], once)
        return self._senses * self._swing * wave

    def _chirp_poses(self, share: float) -> np.ndarray:
        """Targets of the larger chirp with a share of the swing of both chirps, (T, n)."""
        config = self._config
        times_s = np.arange(0.0, 2.0 * config.chirp_s, 1.0 / CLEAR_HZ).tolist()
        offsets = [self._chirp(each % config.chirp_s) + share * self._slow_swing(each) for each in times_s]
        return self._middle + np.array(offsets)

    def _burst(self, time_s: float) -> np.ndarray:
        """Torque with random changes of sign, ten times a second, N m."""
        config = self._config
        if time_s > config.burst_s - 0.3:
            return np.zeros_like(self._middle)
        signs = self._signs[int(time_s / 0.1) % len(self._signs)]
        torque: np.ndarray = config.burst_share * self._robot.motor.peak_torque * signs
        return torque


def swing_senses(robot: Robot) -> np.ndarray:
    """Signs, (n,), with which all legs swing in the same direction of the body frame."""
    model = training_model(robot)
    data = mujoco.MjData(model)
    qpos_addresses, _ = joint_addresses(model, robot)
    data.qpos[qpos_addresses] = robot.default_pose
    mujoco.mj_kinematics(model, data)
    axes = np.array([data.xaxis[model.joint(name).id] for name in robot.joint_names])
    largest = np.take_along_axis(axes, np.abs(axes).argmax(axis=1)[:, None], axis=1)[:, 0]
    return np.where(largest < 0.0, -1.0, 1.0)
