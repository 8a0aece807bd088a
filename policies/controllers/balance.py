"""Balance on standing feet by ankles, hips and the centre of mass.

The capture point (the divergent part of an inverted pendulum's motion, Englsberger et al. 2015)

    x = c + v / w,    w = sqrt(g / height)

diverges from the centre of pressure p as dx/dt = w (x - p). The controller puts the centre of pressure beyond
the capture point, by a share of its distance from the middle of the support. This accelerates the centre of
mass by w^2 (c - p). Within the soles, the ankles move the centre of pressure. For the rest, the quadratic
program uses angular momentum: the upper body turns about the hips.
"""

import math
from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_between, require_not_negative, require_positive
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.whole_body.control import WholeBodyConfig, WholeBodyControl
from footfall.policies.controllers.whole_body.dynamics import Dynamics
from footfall.policies.controllers.whole_body.feedback import (
    Feedback,
    base_tilt,
    estimated_dynamics,
    pendulum_rate,
    rest_dynamics,
)
from footfall.policies.controllers.whole_body.problem import Desired
from footfall.policies.policy import RATES_HZ, PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot


@dataclass(frozen=True)
class BalanceConfig:
    """Gains of `Balance`."""

    rate_hz: float
    capture_gain: float  # shift of the centre of pressure per distance of the capture point
    max_lead_m: float  # largest distance of the desired centre of pressure from the middle of the support
    height: Feedback
    attitude: Feedback
    posture: Feedback
    momentum_damping: float  # 1/s
    max_force: float  # limit for all points of a foot together, each an equal part; share of the weight
    settle_s: float  # duration of the move from the pose at reset to the default pose
    whole_body: WholeBodyConfig

    def __post_init__(self) -> None:
        require_between(self, *RATES_HZ, "rate_hz")
        require_positive(self, "max_lead_m", "max_force", "settle_s")
        require_not_negative(self, "capture_gain", "momentum_damping")


class Balance:
    """Stands on all feet and keeps the centre of mass above them."""

    name = "balance"
    needs_estimate = True
    contract = None

    def __init__(self, robot: Robot, config: BalanceConfig | None = None) -> None:
        self._config = config = config or controller_settings(robot, self.name, BalanceConfig)
        self.rate_hz = config.rate_hz
        self.control = WholeBodyControl(robot, config.whole_body, 1.0 / config.rate_hz)
        body = self.control.body
        self._default = robot.default_pose
        self._max_force = np.full(body.points, config.max_force * body.weight_n)
        self._max_force /= np.bincount(body.foot_of_point)[body.foot_of_point]
        rest = rest_dynamics(body, robot)
        self.com_height_m = float((rest.centre - rest.feet_middle)[2])
        self._start_height, self._start_pose = self.com_height_m, self._default
        self._stance = np.ones(body.feet)

    def reset(self, inputs: PolicyInput) -> None:
        self.control.reset()
        dynamics = estimated_dynamics(self.control.body, inputs)
        self._start_height = float((dynamics.centre - dynamics.feet_middle)[2])
        self._start_pose = inputs.sensed.joint_position.copy()

    def act(self, inputs: PolicyInput) -> JointCommand:
        config, sensed = self._config, inputs.sensed
        dynamics = estimated_dynamics(self.control.body, inputs)
        share = min(1.0, inputs.time_s / config.settle_s)
        height = self._start_height + share * (self.com_height_m - self._start_height)
        pose = self._start_pose + share * (self._default - self._start_pose)
        desired = Desired(
            centre=self._centre_acceleration(dynamics, height),
            momentum_rate=-config.momentum_damping * dynamics.angular_momentum,
            attitude=config.attitude(base_tilt(sensed.quaternion, dynamics), sensed.gyro),
            feet=np.zeros((self.control.body.feet, 6)),
            joints=config.posture(sensed.joint_position - pose, sensed.joint_velocity),
        )
        position, velocity = sensed.joint_position, sensed.joint_velocity
        return self.control.command(dynamics, position, velocity, desired, self._max_force)

    @property
    def notes(self) -> tuple[str, ...]:
        return self.control.notes

    def stance(self) -> np.ndarray | None:
        return self._stance

    def _centre_acceleration(self, dynamics: Dynamics, height: float) -> np.ndarray:
        """Desired acceleration of the centre of mass, (3,) m/s^2."""
        config = self._config
        centre = dynamics.centre - dynamics.feet_middle
        rate = pendulum_rate(self.com_height_m)
        capture = centre + dynamics.centre_velocity / rate
        pressure = (1.0 + config.capture_gain) * capture
        lead_m = math.hypot(pressure[0], pressure[1])
        pressure *= min(1.0, config.max_lead_m / max(lead_m, 1e-9))
        acceleration = rate**2 * (centre - pressure)
        deviation = np.array([centre[2] - height])
        acceleration[2] = config.height(deviation, dynamics.centre_velocity[2:])[0]
        return acceleration
