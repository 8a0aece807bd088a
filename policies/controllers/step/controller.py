"""Footstep controller for bipeds, by whole-body control."""

import numpy as np

from footfall.common.errors import UserError
from footfall.common.rotations import heading_matrix, yaw_of
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.step.centre_offset import CentreOffset
from footfall.policies.controllers.step.config import StepConfig
from footfall.policies.controllers.step.footwork import UNLOADED, Footwork
from footfall.policies.controllers.whole_body.control import WholeBodyControl
from footfall.policies.controllers.whole_body.dynamics import Dynamics
from footfall.policies.controllers.whole_body.feedback import (
    base_tilt,
    estimated_dynamics,
    pendulum_rate,
    rest_dynamics,
)
from footfall.policies.controllers.whole_body.problem import Desired
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot


class Step:
    """Walks on two feet: each foothold catches the falling body."""

    name = "step"
    needs_estimate = True
    contract = None

    def __init__(self, robot: Robot, config: StepConfig | None = None) -> None:
        """Raises UserError unless the robot has one left and one right foot."""
        self._config = config = config or controller_settings(robot, self.name, StepConfig)
        self.rate_hz = config.rate_hz
        self.control = WholeBodyControl(robot, config.whole_body, 1.0 / config.rate_hz)
        body = self.control.body
        rest = rest_dynamics(body, robot)
        if body.feet != 2 or not rest.foot[:, 1].min() < 0.0 < rest.foot[:, 1].max():
            raise UserError(
                f"robot '{robot.name}' cannot be walked by 'step': it must have a left and a right foot"
            )
        self._default = robot.default_pose
        self.com_height_m = float((rest.centre - rest.feet_middle)[2]) - config.lower_m
        self.footwork = Footwork(config, np.sign(rest.foot[:, 1]), pendulum_rate(self.com_height_m))
        points = np.bincount(body.foot_of_point)
        self._max_force = (config.max_force * body.weight_n / points)[body.foot_of_point]
        self._offset = CentreOffset(body.weight_n, self.footwork.fall_rate, config.rate_hz)
        self._begin(self.com_height_m + config.lower_m)

    def reset(self, inputs: PolicyInput) -> None:
        dynamics = estimated_dynamics(self.control.body, inputs)
        self._begin(float((dynamics.centre - dynamics.feet_middle)[2]))

    def _begin(self, height: float) -> None:
        self.control.reset()
        self.footwork.reset()
        self._offset.reset()
        self._start_height, self._yaw, self._centre_error = height, 0.0, np.zeros(2)

    @property
    def notes(self) -> tuple[str, ...]:
        return self.control.notes

    def stance(self) -> np.ndarray | None:
        return self.footwork.load.copy()

    def footholds(self) -> np.ndarray:
        positions, foothold = np.full((2, 3), np.nan), self.footwork.foothold
        if foothold is not None:
            positions[self.footwork.swing_foot] = foothold @ heading_matrix(self._yaw)
        return positions

    def act(self, inputs: PolicyInput) -> JointCommand:
        config, sensed = self._config, inputs.sensed
        self._yaw = yaw_of(sensed.quaternion.tolist())
        dynamics = estimated_dynamics(self.control.body, inputs)
        share = min(1.0, inputs.time_s / config.settle_s)
        settled = share == 1.0
        dynamics = self._corrected(dynamics, sensed.joint_torque, settled)
        pressure, feet = self.footwork.advance(dynamics, inputs.command, settled)

        load = self.footwork.load
        ground_z = float(load @ dynamics.foot[:, 2] / load.sum())
        height = self._start_height + share * (self.com_height_m - self._start_height)
        acceleration = np.zeros(3)
        acceleration[:2] = self.footwork.fall_rate**2 * (dynamics.centre[:2] - pressure)
        deviation = np.array([dynamics.centre[2] - ground_z - height])
        acceleration[2] = config.height(deviation, dynamics.centre_velocity[2:])[0]
        desired = Desired(
            centre=acceleration,
            momentum_rate=-config.momentum_damping * dynamics.angular_momentum,
            attitude=config.attitude(base_tilt(sensed.quaternion, dynamics), sensed.gyro),
            feet=feet,
            joints=config.posture(sensed.joint_position - self._default, sensed.joint_velocity),
        )
        max_force = self._max_force * np.where(load > UNLOADED, load, 0.0)[self.control.body.foot_of_point]
        return self.control.command(
            dynamics, sensed.joint_position, sensed.joint_velocity, desired, max_force
        )

    def _corrected(self, dynamics: Dynamics, joint_torque: np.ndarray, settled: bool) -> Dynamics:
        """The dynamics with the centre of mass corrected by the offset measured while the robot settled."""
        to_world = heading_matrix(self._yaw)[:2, :2]
        if not settled:
            self._offset.observe(dynamics, joint_torque)
            self._centre_error = to_world.T @ self._offset.value
            return dynamics
        centre = dynamics.centre.copy()
        centre[:2] += to_world @ self._centre_error
        return dynamics._replace(centre=centre)
