"""Joint commands from desired accelerations, and the fallback without a solution."""

import math
from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_between, require_not_negative, require_positive
from footfall.policies.controllers.solver import BoundedSolver
from footfall.policies.controllers.whole_body.dynamics import Dynamics, WholeBody
from footfall.policies.controllers.whole_body.problem import Contact, Desired, QuadraticPrograms, Weights
from footfall.robots.actuator import JointCommand, limit_torque
from footfall.robots.description import Robot

UNSOLVED = "whole-body control had ticks without a solution: its last torques faded, the joints were damped"


@dataclass(frozen=True)
class JointFeedback:
    """Motor feedback on the integrated accelerations, in addition to the torques."""

    kp: float  # N m/rad, on the integrated position
    kd: float  # N m s/rad, on the integrated velocity
    memory_s: float  # time constant with which the integrals return to the measurement
    friction_compensation: float  # share of the gearbox friction that is compensated

    def __post_init__(self) -> None:
        require_positive(self, "memory_s")
        require_not_negative(self, "kp", "kd")
        require_between(self, 0.0, 1.0, "friction_compensation")


@dataclass(frozen=True)
class NoSolutionConfig:
    """Fallback in ticks without a solution: the last torques fade, the joints are damped."""

    fade_s: float  # time constant of the torques
    kd: float  # N m s/rad
    max_s: float  # time without a solution after which the controller raises NoSolutionError

    def __post_init__(self) -> None:
        require_positive(self, "fade_s", "kd", "max_s")


@dataclass(frozen=True)
class WholeBodyConfig:
    """Settings of `WholeBodyControl`."""

    weights: Weights
    contact: Contact
    joints: JointFeedback
    no_solution: NoSolutionConfig


class NoSolutionError(RuntimeError):
    """The quadratic program had no usable solution for too long."""


class WholeBodyControl:
    """Turns desired accelerations into joint commands, by one quadratic program per tick.

    A tick has no solution if the program has none, or if the solvers do not find it within their iterations.
    `unsolved_ticks` counts such ticks, and `notes` then has a line. `fallbacks` counts the ticks that used
    the second solver. Computing time is not checked here, so that a simulation in lockstep is reproducible:
    the control loop measures it against the period.
    """

    def __init__(self, robot: Robot, config: WholeBodyConfig, dt_s: float) -> None:
        self.body = WholeBody(robot)
        self._config, self._dt_s = config, dt_s
        self._motor = robot.motor
        n = len(robot.joint_names)
        self._kp, self._kd = np.full(n, config.joints.kp), np.full(n, config.joints.kd)
        self._damping, self._zeros = np.full(n, config.no_solution.kd), np.zeros(n)
        self._unlimited = np.array([np.full(n, -np.inf), np.full(n, np.inf)])
        self._programs = QuadraticPrograms(
            self.body.foot_of_point, n, self.body.total_mass, config.weights, config.contact
        )
        self.solver = BoundedSolver(piqp_iterations=30, accept_unfinished=False)
        self.reset()

    def reset(self) -> None:
        """Start a new episode."""
        self._position: np.ndarray | None = None
        self._velocity = self._zeros
        self._torque = self._zeros
        self._unsolved_s = 0.0
        self.unsolved_ticks = 0
        self.notes: tuple[str, ...] = ()

    @property
    def fallbacks(self) -> int:
        """Number of programs that daqp did not finish within its iteration limit."""
        return self.solver.fallbacks

    def command(
        self,
        dynamics: Dynamics,
        joint_position: np.ndarray,
        joint_velocity: np.ndarray,
        desired: Desired,
        max_force: np.ndarray,
    ) -> JointCommand:
        """Joint commands for this tick.

        Args:
            dynamics: current dynamics of the robot.
            joint_position: (n,) rad, measured.
            joint_velocity: (n,) rad/s, measured.
            desired: desired accelerations.
            max_force: (points,) N, largest upward force of each contact point; 0: no contact.

        Raises:
            NoSolutionError: no solution for longer than the settings allow.
        """
        lower, upper = limit_torque(self._unlimited, joint_velocity, self._motor)
        program, torque_map = self._programs.build(dynamics, desired, max_force, lower, upper)
        solution = self.solver.solve(program)
        if solution is None:
            return self._without_solution(joint_position)
        self._unsolved_s = 0.0
        torque = torque_map.torque.dot(solution) + torque_map.torque_offset
        acceleration = torque_map.acceleration[-len(torque) :].dot(solution)
        self._integrate(acceleration, joint_position, joint_velocity)
        self._torque = torque + self._friction(self._velocity)
        assert self._position is not None
        return JointCommand(self._position, self._velocity, self._kp, self._kd, self._torque)

    def _integrate(self, acceleration: np.ndarray, position: np.ndarray, velocity: np.ndarray) -> None:
        """Integrate the solved acceleration into references that slowly return to the measurement."""
        dt_s = self._dt_s
        decay = math.exp(-dt_s / self._config.joints.memory_s)
        if self._position is None:
            self._position, self._velocity = position, velocity
        previous = velocity + decay * (self._velocity - velocity)
        self._velocity = previous + acceleration * dt_s
        self._position = position + decay * (self._position - position) + self._velocity * dt_s

    def _friction(self, velocity: np.ndarray) -> np.ndarray:
        """Torque that compensates gearbox friction at a desired velocity (n,), N m."""
        motor = self._motor
        share = self._config.joints.friction_compensation
        saturated = np.minimum(np.maximum(velocity / motor.friction_speed, -1.0), 1.0)
        return share * (motor.friction * saturated + motor.damping * velocity)

    def _without_solution(self, position: np.ndarray) -> JointCommand:
        config = self._config.no_solution
        self.unsolved_ticks += 1
        self.notes = (UNSOLVED,)
        self._unsolved_s += self._dt_s
        if self._unsolved_s > config.max_s:
            raise NoSolutionError(f"whole-body control found no solution for {config.max_s:g} s")
        self._position = None
        self._torque = self._torque * math.exp(-self._dt_s / config.fade_s)
        return JointCommand(position, self._zeros, self._zeros, self._damping, self._torque)
