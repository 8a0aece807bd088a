"""Footwork of two legs: stance foot, swing foot and centre of pressure."""

import math
from enum import Enum

import numpy as np

from footfall.common.arrays import clamped
from footfall.common.rotations import heading_matrix, wrap_angle
from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.step.config import StepConfig
from footfall.policies.controllers.step.footsteps import NominalStep, capture_after, next_step, nominal_step
from footfall.policies.controllers.step.swing import Swing, matrix_yaw
from footfall.policies.controllers.whole_body.dynamics import Dynamics

UNLOADED = 0.02  # share of its largest force at which a foot counts as unloaded, before lift-off


class Phase(Enum):
    """Phase of the footwork."""

    STAND = "stand"  # double support
    SHIFT = "shift"  # double support, the weight moves onto one foot
    STEP = "step"  # double support at first, then one foot swings


class Footwork:
    """Stands, shifts the weight and steps. Feet are indices into `side`; positions are in world axes.

    Args:
        config: settings of the controller.
        side: (2,) +1 for the left foot, -1 for the right one.
        fall_rate: rate w of the inverted pendulum, 1/s.

    Attributes:
        phase: STAND, SHIFT or STEP, which has lasted `elapsed_s`.
        stance_foot, swing_foot: index of the current or next stance foot, and of the other foot.
        load: (2,) share of its largest force that each foot may use.
        next_foothold: (2,) m, relative to the stance foot.
        yaw: rad, yaw of the stance foot at the start of the step.
        lands_after_s: duration of the step.
        swing: trajectory of the swing foot; None before lift-off.
        steps: number of steps since the reset.
        foothold: (3,) m, foothold of the swing foot relative to the base, world axes; None without a swing.
    """

    def __init__(self, config: StepConfig, side: np.ndarray, fall_rate: float) -> None:
        self._config, self.dt_s = config, 1.0 / config.rate_hz
        self.side, self.fall_rate = side, fall_rate
        self.command = ShapedCommand(config.command)
        self.reset()

    def reset(self) -> None:
        """Start in double support."""
        self.command.reset()
        self.phase, self.elapsed_s = Phase.STAND, 0.0
        self.stance_foot, self.swing_foot = 0, 1
        self.load = np.ones(2)
        self.swing: Swing | None = None
        self.lands_after_s = 0.0
        self.yaw, self.next_foothold = 0.0, np.zeros(2)
        self.steps = 0
        self.foothold: np.ndarray | None = None

    def advance(
        self, dynamics: Dynamics, command: np.ndarray, settled: bool
    ) -> tuple[np.ndarray, np.ndarray]:
        """Advance by one tick.

        Args:
            dynamics: current dynamics of the robot.
            command: (3,) forward m/s, leftward m/s, yaw rad/s.
            settled: whether commands are followed already.

        Returns:
            Centre of pressure (2,) m, world, and accelerations of the feet (2, 6), world.
        """
        if settled:
            self.command.advance(command, self.dt_s)
        self.elapsed_s += self.dt_s
        capture = dynamics.centre + dynamics.centre_velocity / self.fall_rate  # its height has no meaning
        if self.phase is Phase.STAND and settled:
            self.maybe_shift(dynamics, capture, self.command.requests_walk(command))
        if self.phase is Phase.SHIFT:
            self.maybe_lift(dynamics, capture)
        if self.phase is Phase.STEP and self.elapsed_s >= self.lands_after_s:
            self.land(dynamics, self.command.requests_walk(command))
        feet = np.zeros((2, 6))
        self.foothold = None
        match self.phase:
            case Phase.STAND:
                pressure = self.double_support_pressure(dynamics, capture, dynamics.feet_middle[:2])
            case Phase.SHIFT:
                pressure = self.double_support_pressure(dynamics, capture, self.shift_goal(dynamics))
            case Phase.STEP:
                pressure, feet[self.swing_foot] = self.step(dynamics, capture)
        return pressure, feet

    def maybe_shift(self, dynamics: Dynamics, capture: np.ndarray, walk: bool) -> None:
        """Start to shift the weight, for a walk or because the capture point is far from the middle."""
        middle = dynamics.feet_middle
        offset = capture[:2] - middle[:2]
        if walk or math.hypot(offset[0], offset[1]) > self._config.start.capture_m:
            across = dynamics.foot[0] - dynamics.foot[1]
            self.stance_foot = 0 if offset @ across[:2] > 0 else 1  # foot towards which the body leans
            self.swing_foot = 1 - self.stance_foot
            self.phase, self.elapsed_s = Phase.SHIFT, 0.0

    def double_support_pressure(
        self, dynamics: Dynamics, capture: np.ndarray, goal: np.ndarray
    ) -> np.ndarray:
        """Centre of pressure (2,) that moves the capture point to a goal (2,)."""
        pressure = capture[:2] + self._config.pressure.gain * (capture[:2] - goal)
        middle = dynamics.feet_middle[:2]
        lead = pressure - middle
        return middle + lead * min(1.0, self._config.pressure.max_lead_m / max(math.hypot(*lead), 1e-9))

    def shift_goal(self, dynamics: Dynamics) -> np.ndarray:
        """Capture point (2,) of a steady gait at lift-off of the other foot."""
        gait, nominal = self._config.gait, self.nominal(self.side[self.swing_foot])
        decay = math.exp(-self.fall_rate * (gait.step_s - gait.double_support_s))
        to_world = heading_matrix(matrix_yaw(dynamics.foot_rotation[self.stance_foot]))[:2, :2]
        goal = dynamics.foot[self.stance_foot, :2] + to_world @ (decay * (nominal.foothold + nominal.offset))
        goal_along = to_world.T @ (goal - dynamics.feet_middle[:2])
        goal_along[0] = 0.0
        return dynamics.feet_middle[:2] + to_world @ goal_along

    def maybe_lift(self, dynamics: Dynamics, capture: np.ndarray) -> None:
        """Start a step once the weight is near the stance foot, or the robot falls forward or backward."""
        start = self._config.start
        to_heading = heading_matrix(matrix_yaw(dynamics.foot_rotation[self.stance_foot]))[:2, :2].T
        error = to_heading @ (capture[:2] - self.shift_goal(dynamics))
        outwards = error[1] * self.side[self.stance_foot]
        near = outwards > -start.near_m or self.elapsed_s > start.max_s
        if near or abs(error[0]) > start.urgent_m:
            self.lift(dynamics, after_shift=True)

    def lift(self, dynamics: Dynamics, after_shift: bool) -> None:
        """Start a step: the swing foot leaves the ground once it is unloaded."""
        self.phase, self.swing = Phase.STEP, None
        # After a shift the weight is already on the stance foot.
        self.elapsed_s = self._config.gait.double_support_s if after_shift else 0.0
        self.lands_after_s = self._config.gait.step_s
        self.yaw = matrix_yaw(dynamics.foot_rotation[self.stance_foot])
        # Foothold of the swing foot relative to the stance foot, in world axes.
        self.next_foothold = self.to_world() @ self.nominal(self.side[self.swing_foot]).foothold
        self.steps += 1

    def land(self, dynamics: Dynamics, walk: bool) -> None:
        """End a step: stand if the command is zero and the robot is calm, else start the next step."""
        config = self._config
        self.stance_foot, self.swing_foot = self.swing_foot, self.stance_foot
        between = dynamics.foot[self.stance_foot] - dynamics.foot[self.swing_foot]
        capture = dynamics.centre + dynamics.centre_velocity / self.fall_rate
        offset = capture[:2] - dynamics.feet_middle[:2]
        forward = heading_matrix(matrix_yaw(dynamics.foot_rotation[self.stance_foot]))[:2, 0]
        calm = abs(offset @ forward) < config.start.capture_m
        calm = calm and abs(between[:2] @ forward) < config.start.near_m
        if walk or not calm:
            self.lift(dynamics, after_shift=False)
        else:
            self.phase, self.elapsed_s, self.load, self.swing = Phase.STAND, 0.0, np.ones(2), None

    def nominal(self, side: float) -> NominalStep:
        """Step of a steady gait at the current command, for the foot on this side."""
        gait, velocity = self._config.gait, self.command.value[:2]
        return nominal_step(velocity, side, gait.apart_m, gait.step_s, gait.double_support_s, self.fall_rate)

    def yaw_per_step(self) -> float:
        """Yaw per step at the current command, rad."""
        return float(self.command.value[2]) * self._config.gait.step_s

    def to_world(self) -> np.ndarray:
        """Rotation from the heading frame of the current step to the world, (2, 2)."""
        return heading_matrix(self.yaw + 0.5 * self.yaw_per_step())[:2, :2]

    def step(self, dynamics: Dynamics, capture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Centre of pressure (2,), and acceleration (6,) of the swing foot."""
        gait, rate = self._config.gait, self.fall_rate
        to_world = self.to_world()
        stance_position, swing = dynamics.foot[self.stance_foot], dynamics.foot[self.swing_foot]
        now = (capture - stance_position)[:2] @ to_world
        swing_foot = (swing - stance_position)[:2] @ to_world

        shift_s = gait.double_support_s - self.elapsed_s
        pressure, at_lift_off = np.zeros(2), now
        if shift_s > 0.0:
            progress = self.elapsed_s / gait.double_support_s
            pressure = (1.0 - progress) * swing_foot
            at_lift_off = capture_after(now, pressure, -swing_foot / gait.double_support_s, shift_s, rate)
            self.load[self.stance_foot] = max(progress, UNLOADED)
            self.load[self.swing_foot] = 1.0 - progress
        else:
            self.load[self.stance_foot], self.load[self.swing_foot] = 1.0, 0.0
        side = self.side[self.swing_foot]
        nominal = self.nominal(side)
        after_s = max(self.elapsed_s, gait.double_support_s)
        correction, constant = self.steering_pressure(at_lift_off, nominal, self.lands_after_s - after_s)
        if self.lands_after_s - after_s > gait.limits.min_swing_s:
            remaining_m = math.hypot(*(self.next_foothold @ to_world - swing_foot))
            step = next_step(
                at_lift_off, constant, after_s, remaining_m, side, rate, nominal, gait.limits, gait.weights
            )
            self.next_foothold, self.lands_after_s = to_world @ step.foothold, after_s + step.remaining_s
        remaining_s = self.lands_after_s - after_s
        pressure = pressure + correction
        acceleration = np.zeros(6)
        if shift_s <= 0.0:
            acceleration = self.swing_acceleration(dynamics, stance_position, remaining_s)
        return stance_position[:2] + to_world @ pressure, acceleration

    def steering_pressure(
        self, capture: np.ndarray, nominal: NominalStep, remaining_s: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Current centre of pressure (2,), and the constant one with the same effect until touch-down.
        It moves the capture point to its position in the nominal step, within the sole. The step
        corrects the rest.
        """
        config = self._config.pressure
        half_size = np.array([config.half_length_m, config.half_width_m])
        growth = math.exp(self.fall_rate * max(remaining_s, self.dt_s))
        error = capture - (nominal.foothold + nominal.offset) / growth
        now, constant = (1.0 + config.gain) * error, error * growth / (growth - 1.0)
        return clamped(now, -half_size, half_size), clamped(constant, -half_size, half_size)

    def swing_acceleration(
        self, dynamics: Dynamics, stance_position: np.ndarray, remaining_s: float
    ) -> np.ndarray:
        """Acceleration (6,) of the swing foot towards its foothold."""
        config, foot = self._config.swing, self.swing_foot
        rotation = dynamics.foot_rotation[foot]
        position, yaw = dynamics.foot[foot] - stance_position, matrix_yaw(rotation)
        if self.swing is None:
            self.swing = Swing(position[:2], float(position[2]), yaw, config.lift_m, config.depth_m)
        turned = self.swing.yaw + wrap_angle(self.yaw + self.yaw_per_step() - self.swing.yaw)
        goal = np.array([*self.next_foothold, turned])
        self.foothold = stance_position + np.array([*self.next_foothold, 0.0])
        desired, velocity, acceleration = self.swing.advance(goal, remaining_s, self.dt_s)
        motion = dynamics.foot_jacobian[foot] @ dynamics.velocity
        up = rotation[:, 2]
        tilt = np.array([-up[1], up[0], wrap_angle(yaw - desired[3])])
        result = np.zeros(6)
        result[:3] = acceleration[:3] + config.place(position - desired[:3], motion[:3] - velocity[:3])
        result[3:] = config.attitude(tilt, motion[3:] - np.array([0.0, 0.0, velocity[3]]))
        result[5] += acceleration[3]
        return result
