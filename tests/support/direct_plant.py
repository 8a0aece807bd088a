"""A robot without a bus: MuJoCo, the joint law and noisy readings, for the controllers' own tests."""

from collections.abc import Callable

import mujoco
import numpy as np

from footfall.common.rotations import normalised, rotation_matrix
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.actuator import JointCommand, joint_torque
from footfall.robots.description import Robot
from footfall.robots.model import IMU, joint_addresses, plant_model

JOINT_RATE_HZ = 500


class DirectPlant:
    """Steps the plant at its own rate under one joint command per call."""

    def __init__(self, robot: Robot, seed: int = 0) -> None:
        self.robot = robot
        self.model = plant_model(robot)
        self.data = mujoco.MjData(self.model)
        self._q, self._v = joint_addresses(self.model, robot)
        self._feet = [self.model.geom(foot.geoms[0]).id for foot in robot.description.feet]
        self.base = self.model.body(robot.description.base).id
        self._rng = np.random.default_rng(seed)
        self._torque = np.zeros(len(self._q))
        self.data.qpos[3] = 1.0
        self.data.qpos[self._q] = robot.default_pose
        mujoco.mj_kinematics(self.model, self.data)
        lowest = min(self.data.geom_xpos[g, 2] - self.model.geom_size[g, 0] for g in self._feet)
        self.data.qpos[2] -= lowest
        mujoco.mj_forward(self.model, self.data)

    def step(self, command: JointCommand) -> None:
        """One tick of the joints."""
        for _ in range(round(1 / (JOINT_RATE_HZ * self.model.opt.timestep))):
            position, velocity = self.data.qpos[self._q], self.data.qvel[self._v]
            self._torque = joint_torque(command, position, velocity, self.robot.motor)
            self.data.qfrc_applied[self._v] = self._torque
            mujoco.mj_step(self.model, self.data)

    def sensed(self) -> Sensed:
        """Noisy readings of the present state."""
        noise, n = self._rng.standard_normal, len(self._q)
        return Sensed(
            gyro=self.data.qvel[3:6] + 0.02 * noise(3),
            acceleration=self.data.sensor(IMU).data + 0.1 * noise(3),
            quaternion=normalised(self.data.qpos[3:7] + 0.002 * noise(4)),
            joint_position=self.data.qpos[self._q] + 0.0005 * noise(n),
            joint_velocity=self.data.qvel[self._v] + 0.05 * noise(n),
            joint_torque=self._torque + 0.05 * noise(n),
        )

    def velocity(self) -> np.ndarray:
        """True velocity of the base origin in the body frame."""
        return rotation_matrix(self.data.qpos[3:7]).T @ self.data.qvel[:3]

    def height(self) -> float:
        """True height of the base above a standing foot's centre."""
        return float(self.data.qpos[2]) - float(self.model.geom_size[self._feet[0], 0])

    def fallen(self) -> bool:
        """Whether the base is tilted by more than 60 degrees or has sunk to the ground."""
        return bool(rotation_matrix(self.data.qpos[3:7])[2, 2] < 0.5 or self.data.qpos[2] < 0.12)


class Walk:
    """Records of `walk`: arrays over ticks."""

    def __init__(self) -> None:
        self.time: list[float] = []
        self.velocity: list[np.ndarray] = []
        self.yaw_rate: list[float] = []
        self.position: list[np.ndarray] = []
        self.fell = False

    def mean_velocity(self, after_s: float) -> np.ndarray:
        """Mean forward, leftward velocity and yaw rate from a time on, (3,)."""
        counted = np.array(self.time) > after_s
        rates = np.column_stack([np.array(self.velocity)[:, :2], self.yaw_rate])
        return np.array(rates[counted].mean(axis=0))


def walk(
    policy: Policy,
    plant: DirectPlant,
    command: Callable[[float], np.ndarray],
    duration_s: float,
    estimator: object | None = None,
    push: tuple[float, np.ndarray] | None = None,
    on_tick: Callable[[float, DirectPlant], None] | None = None,
) -> Walk:
    """Run a policy on a plant until the time is over or it falls.

    Args:
        command: commanded velocity (3,) over time.
        estimator: gives base velocity and height; without one, the policy gets the true values.
        push: a time and a change of the base's velocity (world frame) at that time.
        on_tick: called at each tick with the time and the plant.
    """
    result = Walk()
    ticks_per_step = round(JOINT_RATE_HZ / policy.rate_hz)
    joint_command = None
    if estimator is not None:
        estimator.reset(plant.sensed())  # type: ignore[attr-defined]
    for tick in range(round(duration_s * JOINT_RATE_HZ)):
        time_s = tick / JOINT_RATE_HZ
        sensed = plant.sensed()
        velocity, height = plant.velocity(), plant.height()
        if estimator is not None:
            planned = policy.stance() if tick else None
            velocity, height = estimator.update(sensed, planned, 1 / JOINT_RATE_HZ)  # type: ignore[attr-defined]
        commanded = command(time_s)
        if tick % ticks_per_step == 0:
            inputs = PolicyInput(time_s, sensed, commanded, velocity, height)
            if tick == 0:
                policy.reset(inputs)
            joint_command = policy.act(inputs)
        assert joint_command is not None
        if push is not None and tick == round(push[0] * JOINT_RATE_HZ):
            plant.data.qvel[:3] += push[1]
        plant.step(joint_command)
        result.time.append(time_s)
        result.velocity.append(plant.velocity())
        result.yaw_rate.append(float(plant.data.qvel[5]))
        result.position.append(plant.data.qpos[:2].copy())
        if on_tick is not None:
            on_tick(time_s, plant)
        if plant.fallen():
            result.fell = True
            break
    return result
