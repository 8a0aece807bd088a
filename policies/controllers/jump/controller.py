"""Jumps forward during a forward command; stands before and after.

The model-predictive controller stands, and steps if the landing was too fast to stop. Whole-body control
moves the base along the planned crouch and push, within friction and torque limits. In flight the joints
follow the planned path of the feet, which stays level whatever the attitude of the base. Compliant joints
absorb the landing.
"""

import numpy as np

from footfall.common.rotations import heading_matrix, roll_pitch_yaw, rotation_matrix, wrap_angle, yaw_of
from footfall.policies.controllers.jump.config import JointGains, JumpConfig
from footfall.policies.controllers.jump.motion import LeapPlan
from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import nominal_feet
from footfall.policies.controllers.whole_body.control import WholeBodyControl
from footfall.policies.controllers.whole_body.feedback import estimated_dynamics
from footfall.policies.controllers.whole_body.problem import Desired
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.rigid_body import nominal_body

_ZERO_COMMAND = np.zeros(3)


class Jump:
    """Stands. A forward command makes it jump, repeatedly while the command lasts."""

    name = "jump"
    needs_estimate = True
    contract = None

    def __init__(self, robot: Robot, config: JumpConfig | None = None) -> None:
        self._config = config = config or controller_settings(robot, self.name, JumpConfig)
        self.rate_hz = config.plan.rate_hz
        self._robot, self._legs = robot, robot.legs
        self._stand = Mpc(robot, config.plan)
        self._control = WholeBodyControl(robot, config.whole_body, 1.0 / self.rate_hz)
        self._plan = LeapPlan(config)
        self._inertia = nominal_body(robot).inertia
        stance, body = config.plan.stance, self._control.body
        self._feet_at_rest = nominal_feet(self._legs, 0.0, stance.outward_m, stance.shift_m)
        self._max_force = np.full(body.points, config.push.max_force_n)
        self._max_force /= np.bincount(body.foot_of_point)[body.foot_of_point]
        self._begin()

    @property
    def notes(self) -> tuple[str, ...]:
        return self._control.notes

    def reset(self, inputs: PolicyInput) -> None:
        self._begin()
        self._start_stance(inputs)

    def act(self, inputs: PolicyInput) -> JointCommand:
        if self._time_s is None and self._requests_jump(inputs):
            self._start_jump(inputs)
        if self._time_s is None:
            return self._stand.act(self._stance_inputs(inputs))
        self._time_s += 1.0 / self.rate_hz
        flown_s = self._time_s - self._plan.take_off_s
        if flown_s < 0.0:
            return self._push(inputs, self._time_s)
        landing = self._config.landing
        if flown_s < self._plan.flight_s + landing.lasts_s:
            gains = self._config.air if flown_s < self._plan.flight_s else landing.gains
            return self._fly(inputs, flown_s, gains)
        self._start_stance(inputs)
        return self._stand.act(self._stance_inputs(inputs))

    def stance(self) -> np.ndarray | None:
        if self._time_s is None:
            return self._stand.stance()
        flown_s = self._time_s - self._plan.take_off_s
        return np.full(self._legs.count, 0.0 if 0.0 <= flown_s < self._plan.flight_s else 1.0)

    def _begin(self) -> None:
        self._time_s: float | None = None  # since the start of the crouch; None in stance
        self._stance_start_s = 0.0  # policy time at which the current stance began
        self._yaw, self._height = 0.0, self._config.plan.stance.height_m

    def _requests_jump(self, inputs: PolicyInput) -> bool:
        """Whether the command asks for a jump and the robot has stood long enough on all feet."""
        plan = self._stand.stance()
        if plan is None or plan.min() < 1.0:
            self._stance_start_s = inputs.time_s
        settled = inputs.time_s - self._stance_start_s >= self._config.settle_s
        return settled and bool(inputs.command[0] > self._config.plan.command.standing_command)

    def _start_stance(self, inputs: PolicyInput) -> None:
        self._time_s, self._stance_start_s = None, inputs.time_s
        self._stand.reset(inputs)

    def _stance_inputs(self, inputs: PolicyInput) -> PolicyInput:
        return inputs._replace(time_s=inputs.time_s - self._stance_start_s, command=_ZERO_COMMAND)

    def _start_jump(self, inputs: PolicyInput) -> None:
        self._time_s = 0.0
        self._yaw, self._height = _yaw(inputs), inputs.base_height
        self._control.reset()

    def _push(self, inputs: PolicyInput, time_s: float) -> JointCommand:
        """Command that moves the base along its planned path while the feet stand."""
        config, body, sensed = self._config.push, self._control.body, inputs.sensed
        dynamics = estimated_dynamics(body, inputs)
        rotation = rotation_matrix(sensed.quaternion)
        to_world = heading_matrix(self._yaw)
        aim = self._plan.base(time_s, self._height)
        position = -dynamics.feet_middle.dot(to_world)  # of the base, heading frame
        velocity = rotation.dot(inputs.base_velocity).dot(to_world)
        position[0] += self._config.plan.stance.shift_m
        deviation, rate = position.copy(), velocity.copy()
        deviation[[0, 2]] -= aim.position
        rate[[0, 2]] -= aim.velocity
        acceleration = config.centre(deviation, rate)
        acceleration[[0, 2]] += aim.acceleration
        roll, pitch, yaw = roll_pitch_yaw(rotation)
        tilt = np.array([roll, pitch, wrap_angle(yaw - self._yaw)])
        angular = config.attitude(tilt, sensed.gyro)  # angular acceleration
        desired = Desired(
            centre=to_world.dot(acceleration),
            momentum_rate=rotation.dot(self._inertia.dot(angular)),
            attitude=angular,
            feet=np.zeros((body.feet, 6)),
            joints=np.zeros_like(sensed.joint_position),
        )
        angles, rates = sensed.joint_position, sensed.joint_velocity
        return self._control.command(dynamics, angles, rates, desired, self._max_force)

    def _fly(self, inputs: PolicyInput, flown_s: float, gains: JointGains) -> JointCommand:
        """Command that moves the feet along their planned path, which stays level."""
        legs, sensed = self._legs, inputs.sensed
        feet, velocity = self._plan.feet(flown_s)
        to_level = heading_matrix(_yaw(inputs)).T.dot(rotation_matrix(sensed.quaternion))  # from the base
        angles = legs.solve((self._feet_at_rest + feet).dot(to_level))
        foot_velocity = np.tile(velocity.dot(to_level), (legs.count, 1))[:, :, None]
        position = legs.scatter(angles, self._robot.default_pose)
        pose = legs.pose(position)
        rates = legs.joint_rates(pose.jacobian, foot_velocity)[:, :, 0]
        zero = np.zeros_like(sensed.joint_position)
        return JointCommand(
            position,
            legs.scatter(rates, zero),
            zero + gains.kp,
            zero + gains.kd,
            zero,
        )


def _yaw(inputs: PolicyInput) -> float:
    return yaw_of(inputs.sensed.quaternion.tolist())
