"""The step controller: standing, shifting the weight, stepping."""

import math
from enum import Enum

import numpy as np

from footfall.common.errors import UserError
from footfall.common.rotations import heading_matrix, wrap_angle
from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.step.config import StepConfig
from footfall.policies.controllers.step.footsteps import NominalStep, capture_after, next_step, nominal_step
from footfall.policies.controllers.step.swing import Swing, yaw_of
from footfall.policies.controllers.whole_body.control import WholeBodyControl
from footfall.policies.controllers.whole_body.dynamics import Dynamics
from footfall.policies.controllers.whole_body.feedback import base_tilt, observed, pendulum_rate, standing
from footfall.policies.controllers.whole_body.problem import Wanted
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

UNLOADED = 0.02  # share of a foot's force that a foot about to leave the ground still may press with


class Phase(Enum):
    """What the feet do."""

    STAND = "stand"  # both bear
    SHIFT = "shift"  # both bear, the weight moves onto one
    STEP = "step"  # one bears, the other swings, after a while in which both bear


class Step:
    """Walks on two feet by placing them where they catch the falling body."""

    name = "step"
    needs_estimate = True
    contract = None

    def __init__(self, robot: Robot, config: StepConfig | None = None) -> None:
        """Raises UserError for a robot that has not one left and one right foot."""
        self._config = config = config or controller_settings(robot, self.name, StepConfig)
        self.rate_hz, self._dt_s = config.rate_hz, 1.0 / config.rate_hz
        self.control = WholeBodyControl(robot, config.whole_body, self._dt_s)
        body = self.control.body
        rest = standing(body, robot)
        if body.feet != 2 or not rest.foot[:, 1].min() < 0.0 < rest.foot[:, 1].max():
            raise UserError(
                f"robot '{robot.name}' cannot be walked by 'step': it needs a left and a right foot"
            )
        self._side = np.sign(rest.foot[:, 1])  # +1 of the left foot
        self._default = robot.default_pose
        self._height = float((rest.centre - rest.middle)[2]) - config.lower_m
        self._fall_rate = pendulum_rate(self._height)
        points = np.bincount(body.foot_of_point)
        self._most_force = (config.most_force * body.weight_n / points)[body.foot_of_point]
        self._command = ShapedCommand(config.command)
        self._begin(self._height + config.lower_m)

    def reset(self, inputs: PolicyInput) -> None:
        dynamics = observed(self.control.body, inputs)
        self._begin(float((dynamics.centre - dynamics.middle)[2]))

    def _begin(self, height: float) -> None:
        self.control.reset()
        self._command.reset()
        self._start_height = height
        self.phase, self._elapsed_s = Phase.STAND, 0.0
        self._bears, self._swings = 0, 1  # feet
        self._load = np.ones(2)
        self._swing: Swing | None = None
        self._lands_after_s = 0.0
        self.steps = 0

    @property
    def notes(self) -> tuple[str, ...]:
        return self.control.notes

    def stance(self) -> np.ndarray | None:
        return self._load.copy()

    def act(self, inputs: PolicyInput) -> JointCommand:
        config, sensed = self._config, inputs.sensed
        dynamics = observed(self.control.body, inputs)
        settled = min(1.0, inputs.time_s / config.settle_s)
        if settled == 1.0:
            self._command.advance(inputs.command, self._dt_s)
        self._elapsed_s += self._dt_s
        feet = np.zeros((2, 6))
        capture = dynamics.centre + dynamics.centre_velocity / self._fall_rate  # its height means nothing
        if self.phase is Phase.STAND and settled == 1.0:
            self._consider_a_step(dynamics, capture, self._command.wants_walk(inputs.command))
        if self.phase is Phase.SHIFT:
            self._consider_lifting(dynamics, capture)
        if self.phase is Phase.STEP and self._elapsed_s >= self._lands_after_s:
            self._land(dynamics, self._command.wants_walk(inputs.command))
        match self.phase:
            case Phase.STAND:
                pressure = self._both_press(dynamics, capture, dynamics.middle[:2])
            case Phase.SHIFT:
                pressure = self._both_press(dynamics, capture, self._shifted(dynamics))
            case Phase.STEP:
                pressure, feet[self._swings] = self._step(dynamics, capture)

        bearing = self._load > UNLOADED
        ground = float(self._load @ dynamics.foot[:, 2] / self._load.sum())
        height = self._start_height + settled * (self._height - self._start_height)
        acceleration = np.zeros(3)
        acceleration[:2] = self._fall_rate**2 * (dynamics.centre[:2] - pressure)
        deviation = np.array([dynamics.centre[2] - ground - height])
        acceleration[2] = config.height(deviation, dynamics.centre_velocity[2:])[0]
        wanted = Wanted(
            centre=acceleration,
            momentum_rate=-config.momentum_damping * dynamics.angular_momentum,
            attitude=config.attitude(base_tilt(sensed.quaternion, dynamics), sensed.gyro),
            feet=feet,
            joints=config.posture(sensed.joint_position - self._default, sensed.joint_velocity),
        )
        most = self._most_force * np.where(bearing, self._load, 0.0)[self.control.body.foot_of_point]
        return self.control.command(dynamics, sensed.joint_position, sensed.joint_velocity, wanted, most)

    # -- standing ------------------------------------------------------------------------------------

    def _consider_a_step(self, dynamics: Dynamics, capture: np.ndarray, walk: bool) -> None:
        middle = dynamics.middle
        away = capture[:2] - middle[:2]
        if walk or math.hypot(away[0], away[1]) > self._config.start.capture_m:
            across = dynamics.foot[0] - dynamics.foot[1]
            self._bears = 0 if away @ across[:2] > 0 else 1  # whom the body already leans on
            self._swings = 1 - self._bears
            self.phase, self._elapsed_s = Phase.SHIFT, 0.0

    def _both_press(self, dynamics: Dynamics, capture: np.ndarray, goal: np.ndarray) -> np.ndarray:
        """The centre of pressure (2,) that brings the capture point to a goal (2,)."""
        pressure = capture[:2] + self._config.pressure.gain * (capture[:2] - goal)
        middle = dynamics.middle[:2]
        lead = pressure - middle
        return middle + lead * min(1.0, self._config.pressure.most_lead_m / max(math.hypot(*lead), 1e-9))

    def _shifted(self, dynamics: Dynamics) -> np.ndarray:
        """Where the capture point is in a steady gait when the other foot leaves the ground, (2,)."""
        gait, nominal = self._config.gait, self._nominal(self._side[self._swings])
        begins = math.exp(-self._fall_rate * (gait.step_s - gait.double_support_s))
        to_world = heading_matrix(yaw_of(dynamics.foot_rotation[self._bears]))[:2, :2]
        goal = dynamics.foot[self._bears, :2] + to_world @ (begins * (nominal.place + nominal.offset))
        goal_along = to_world.T @ (goal - dynamics.middle[:2])
        goal_along[0] = 0.0
        return dynamics.middle[:2] + to_world @ goal_along

    def _consider_lifting(self, dynamics: Dynamics, capture: np.ndarray) -> None:
        start = self._config.start
        to_heading = heading_matrix(yaw_of(dynamics.foot_rotation[self._bears]))[:2, :2].T
        missing = to_heading @ (capture[:2] - self._shifted(dynamics))
        outwards = missing[1] * self._side[self._bears]
        shifted = outwards > -start.near_m or self._elapsed_s > start.most_s
        if shifted or abs(missing[0]) > start.urgent_m:
            self._lift(dynamics, shifted=True)

    # -- stepping ------------------------------------------------------------------------------------

    def _lift(self, dynamics: Dynamics, shifted: bool) -> None:
        """Begin a step: the swinging foot leaves the ground once it bears no more."""
        self.phase, self._swing = Phase.STEP, None
        # After a shift the weight is on the standing foot already.
        self._elapsed_s = self._config.gait.double_support_s if shifted else 0.0
        self._lands_after_s = self._config.gait.step_s
        self._yaw = yaw_of(dynamics.foot_rotation[self._bears])
        # Where the other foot shall land, from this one, along the world's axes.
        self._place = self._to_world() @ self._nominal(self._side[self._swings]).place
        self.steps += 1

    def _land(self, dynamics: Dynamics, walk: bool) -> None:
        config = self._config
        self._bears, self._swings = self._swings, self._bears
        between = dynamics.foot[self._bears] - dynamics.foot[self._swings]
        capture = dynamics.centre + dynamics.centre_velocity / self._fall_rate
        away = capture[:2] - dynamics.middle[:2]
        ahead = heading_matrix(yaw_of(dynamics.foot_rotation[self._bears]))[:2, 0]
        calm = abs(away @ ahead) < config.start.capture_m and abs(between[:2] @ ahead) < config.start.near_m
        if walk or not calm:
            self._lift(dynamics, shifted=False)
        else:
            self.phase, self._elapsed_s, self._load, self._swing = Phase.STAND, 0.0, np.ones(2), None

    def _nominal(self, side: float) -> NominalStep:
        gait, velocity = self._config.gait, self._command.value[:2]
        return nominal_step(velocity, side, gait.apart_m, gait.step_s, gait.double_support_s, self._fall_rate)

    def _turn(self) -> float:
        """How far the robot shall turn in a step, rad."""
        return float(self._command.value[2]) * self._config.gait.step_s

    def _to_world(self) -> np.ndarray:
        """From the heading frame of the present step to the world, (2, 2)."""
        return heading_matrix(self._yaw + 0.5 * self._turn())[:2, :2]

    def _step(self, dynamics: Dynamics, capture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The centre of pressure (2,), and the acceleration (6,) of the foot that swings."""
        gait, rate = self._config.gait, self._fall_rate
        to_world = self._to_world()
        stand, swing = dynamics.foot[self._bears], dynamics.foot[self._swings]
        now = (capture - stand)[:2] @ to_world
        leaving = (swing - stand)[:2] @ to_world

        shift_s = gait.double_support_s - self._elapsed_s
        pressure, ahead = np.zeros(2), now
        if shift_s > 0.0:
            done = self._elapsed_s / gait.double_support_s
            pressure = (1.0 - done) * leaving
            ahead = capture_after(now, pressure, -leaving / gait.double_support_s, shift_s, rate)
            share = max(done, UNLOADED)
            self._load[self._bears], self._load[self._swings] = share, 1.0 - done
        else:
            self._load[self._bears], self._load[self._swings] = 1.0, 0.0
        side = self._side[self._swings]
        nominal = self._nominal(side)
        after_s = max(self._elapsed_s, gait.double_support_s)
        steer, until_landing = self._steer(ahead, nominal, self._lands_after_s - after_s)
        if self._lands_after_s - after_s > gait.limits.least_swing_s:
            way_m = math.hypot(*(self._place @ to_world - leaving))
            step = next_step(
                ahead, until_landing, after_s, way_m, side, rate, nominal, gait.limits, gait.weights
            )
            self._place, self._lands_after_s = to_world @ step.place, after_s + step.remaining_s
        remaining_s = self._lands_after_s - after_s
        pressure = pressure + steer
        foot = np.zeros(6)
        if shift_s <= 0.0:
            foot = self._fly(dynamics, stand, remaining_s)
        return stand[:2] + to_world @ pressure, foot

    def _steer(
        self, capture: np.ndarray, nominal: NominalStep, remaining_s: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """The centre of pressure (2,) now, and the one that comes to the same if held until the foot lands.

        It drives the capture point to where it is in the nominal step, as far as the sole reaches. What it
        cannot make good, the step has to.
        """
        config = self._config.pressure
        most = np.array([config.half_length_m, config.half_width_m])
        growth = math.exp(self._fall_rate * max(remaining_s, self._dt_s))
        missing = capture - (nominal.place + nominal.offset) / growth
        now, held = (1.0 + config.gain) * missing, missing * growth / (growth - 1.0)
        return np.minimum(np.maximum(now, -most), most), np.minimum(np.maximum(held, -most), most)

    def _fly(self, dynamics: Dynamics, stand: np.ndarray, remaining_s: float) -> np.ndarray:
        """The acceleration (6,) of the swinging foot towards its place."""
        config, foot = self._config.swing, self._swings
        rotation = dynamics.foot_rotation[foot]
        here, yaw = dynamics.foot[foot] - stand, yaw_of(rotation)
        if self._swing is None:
            self._swing = Swing(here[:2], float(here[2]), yaw, config.lift_m, config.depth_m)
        turned = self._swing.yaw + wrap_angle(self._yaw + self._turn() - self._swing.yaw)
        goal = np.array([*self._place, turned])
        position, velocity, acceleration = self._swing.advance(goal, remaining_s, self._dt_s)
        motion = dynamics.foot_jacobian[foot] @ dynamics.velocity
        up = rotation[:, 2]
        tilt = np.array([-up[1], up[0], wrap_angle(yaw - position[3])])
        result = np.zeros(6)
        result[:3] = acceleration[:3] + config.place(here - position[:3], motion[:3] - velocity[:3])
        result[3:] = config.attitude(tilt, motion[3:] - np.array([0.0, 0.0, velocity[3]]))
        result[5] += acceleration[3]
        return result
