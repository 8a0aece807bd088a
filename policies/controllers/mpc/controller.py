"""The MPC controller: forces for the feet that stand, trajectories for those that swing.

At the joint rate it follows the base by odometry, steps its clock and turns forces and swing trajectories
into joint commands; at `solve_hz` it plans the forces anew.
"""

import math
import time
from collections import deque
from typing import NamedTuple

import numpy as np

from footfall.common.rotations import cross, heading_matrix, roll_pitch_yaw, rotation_matrix, wrap_angle
from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.gait import StepClock, contact_trust
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.footholds import contact_points, footholds
from footfall.policies.controllers.mpc.legs import LegControl
from footfall.policies.controllers.mpc.problem import BodyState, ForceProblems
from footfall.policies.controllers.mpc.solver import BoundedSolver
from footfall.policies.controllers.mpc.swing import SwingTarget, swing_target
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import nominal_feet
from footfall.policies.policy import Observation
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import LegPose, Legs
from footfall.robots.rigid_body import nominal_body

_TIMINGS_KEPT = 100_000


class Base(NamedTuple):
    """The base as the controller sees it. World: where it was reset, z = 0 on the ground."""

    position: np.ndarray  # (3,) m, of the base's origin
    velocity: np.ndarray  # (3,) m/s, world
    rotation: np.ndarray  # (3, 3) body to world
    gyro: np.ndarray  # (3,) rad/s, body
    roll: float
    pitch: float
    yaw: float


class Mpc:
    """Convex model-predictive control with Raibert footholds and swing impedance.

    `solve_ms` holds the time of each build and solve, `late` the number of solves that fell back.
    """

    name = "mpc"
    needs_estimate = True
    contract = None

    def __init__(self, robot: Robot, config: MpcConfig | None = None) -> None:
        self._config = config = config or controller_settings(robot, self.name, MpcConfig)
        self.rate_hz = config.rate_hz
        self._robot = robot
        self._legs = Legs(robot)
        self._body = nominal_body(robot)
        self._problems = ForceProblems(self._body, config.horizon, config.weights, config.contact)
        self._solver = BoundedSolver()
        offsets = np.array([foot.phase for foot in robot.description.feet])
        self._clock = StepClock(config.gait, offsets)
        self._command = ShapedCommand(config.command)
        stance = config.stance
        self._places = nominal_feet(self._legs, stance.height_m, stance.outward_m, stance.shift_m)
        self._leg_control = LegControl(robot, self._legs, self._body, config)
        self._radius = float(self._legs.foot_radius.mean())
        self._solve_every = max(1, round(config.rate_hz / config.horizon.solve_hz))
        steps, step_s = config.horizon.steps, config.horizon.step_s
        self._middle_of_step = step_s * (np.arange(steps) + 0.5)
        self._end_of_step = step_s * np.arange(1, steps + 1)
        self.solve_ms: deque[float] = deque(maxlen=_TIMINGS_KEPT)
        self._begin(0.0, stance.height_m)

    @property
    def late(self) -> int:
        """Solves that daqp did not finish within its iterations."""
        return self._solver.fallbacks

    def reset(self, observation: Observation) -> None:
        yaw = roll_pitch_yaw(rotation_matrix(observation.sensed.quaternion))[2]
        self._begin(yaw, self._above_ground(observation))

    def _begin(self, yaw: float, height: float) -> None:
        count = self._legs.count
        self._clock.reset()
        self._command.reset()
        self._position = np.array([0.0, 0.0, height])
        self._wanted_position = np.zeros(2)
        self._wanted_velocity = np.zeros(3)
        self._wanted_yaw = yaw
        self._wanted_height = height
        self._force = np.zeros((count, 3))
        self._stands = np.ones(count, dtype=bool)
        self._lift_off = np.zeros((count, 3))
        self._target = np.zeros((count, 3))
        self._ticks_to_solve = 0
        self._unsettled_s = 0.0

    def act(self, observation: Observation) -> JointCommand:
        dt_s = 1.0 / self.rate_hz
        base = self._follow(observation, dt_s)
        pose = self._legs.pose(observation.sensed.joint_position)
        self._step_clock(observation, base, dt_s)
        self._lead(base, dt_s)

        feet = base.position + pose.foot @ base.rotation.T
        lifting = self._stands & ~self._clock.stance()
        landing = ~self._stands & self._clock.stance()
        self._stands = self._clock.stance()
        self._lift_off[lifting] = feet[lifting]
        self._target = self._footholds(base)

        self._ticks_to_solve -= 1
        if self._ticks_to_solve <= 0 or np.any(lifting) or np.any(landing):
            self._plan(base, feet)
            self._ticks_to_solve = self._solve_every
        return self._joint_command(observation, base, pose)

    def stance(self) -> np.ndarray | None:
        if not self._clock.walking:
            return np.ones(self._legs.count)
        return contact_trust(self._clock.phases(), self._config.gait.duty, edge=0.1)

    def _follow(self, observation: Observation, dt_s: float) -> Base:
        """The base's state; its place is dead reckoning, good for the length of a step."""
        rotation = rotation_matrix(observation.sensed.quaternion)
        velocity = rotation @ observation.base_velocity
        self._position = self._position + velocity * dt_s
        self._position[2] = self._above_ground(observation)
        roll, pitch, yaw = roll_pitch_yaw(rotation)
        return Base(self._position, velocity, rotation, observation.sensed.gyro, roll, pitch, yaw)

    def _above_ground(self, observation: Observation) -> float:
        return observation.base_height + self._radius

    def _step_clock(self, observation: Observation, base: Base, dt_s: float) -> None:
        settled = observation.time_s >= self._config.settle_s
        if settled:
            self._command.advance(observation.command, dt_s)
        walk = self._command.wants_walk(observation.command) or self._unsettled(base, dt_s)
        self._clock.advance(dt_s, settled and walk)

    def _unsettled(self, base: Base, dt_s: float) -> bool:
        """Whether a robot that was told to stand had better step, as after a push."""
        restart = self._config.restart
        walking = self._clock.walking
        speed = math.hypot(base.velocity[0], base.velocity[1])
        limit = restart.stop_speed_m_s if walking else restart.start_speed_m_s
        tilted = max(abs(base.roll), abs(base.pitch)) > restart.start_tilt_rad
        if speed > limit or tilted:
            self._unsettled_s = restart.calm_s
        else:
            self._unsettled_s = max(0.0, self._unsettled_s - dt_s)
        return self._unsettled_s > 0.0

    def _lead(self, base: Base, dt_s: float) -> None:
        """Move the reference pose on at the commanded velocity, within a bounded lead over the body."""
        stance = self._config.stance
        forward, leftward, yaw_rate = self._command.value
        self._wanted_velocity = heading_matrix(base.yaw) @ np.array([forward, leftward, 0.0])
        wanted = self._wanted_position + self._wanted_velocity[:2] * dt_s
        ahead = wanted - base.position[:2]
        distance = math.hypot(ahead[0], ahead[1])
        if distance > stance.most_position_lead_m:
            ahead *= stance.most_position_lead_m / distance
        self._wanted_position = base.position[:2] + ahead
        turned = wrap_angle(self._wanted_yaw + yaw_rate * dt_s - base.yaw)
        lead = stance.most_yaw_lead_rad
        self._wanted_yaw = base.yaw + min(lead, max(-lead, turned))
        climb = stance.height_m - self._wanted_height
        self._wanted_height += min(1.0, dt_s / self._config.settle_s) * climb

    def _footholds(self, base: Base) -> np.ndarray:
        gait = self._config.gait
        return footholds(
            base.position,
            base.velocity,
            self._wanted_velocity,
            base.yaw,
            float(self._command.value[2]),
            self._places,
            (1.0 - self._clock.swing()) * gait.swing_s,
            gait.stance_s,
            self._config.foothold,
        )

    def _plan(self, base: Base, feet: np.ndarray) -> None:
        """Solve for the feet's forces; where that fails, keep the last ones of the feet that still stand."""
        began = time.perf_counter()
        contacts = self._clock.planned_stance(self._middle_of_step)
        contacts[0] = self._stands
        state, reference = self._state(base), self._reference(base)
        to_heading = heading_matrix(base.yaw)
        centre = self._path(state, reference)
        grounded = feet.copy()
        grounded[:, 2] = 0.0
        arms = contact_points(
            contacts,
            (grounded - base.position) @ to_heading + self._ground(base),
            (self._target - base.position) @ to_heading + self._ground(base),
            self._places,
            centre,
            reference.attitude[:, 2],
        )
        problem = self._problems.build(state, reference, contacts, arms)
        solution = self._solver.solve(problem)
        if solution is None:
            self._force = self._force * self._stands[:, None]
        else:
            force = self._problems.forces(solution, problem, self._legs.count)
            self._force = force @ to_heading.T
        self.solve_ms.append(1e3 * (time.perf_counter() - began))

    @staticmethod
    def _ground(base: Base) -> np.ndarray:
        """The base's origin in the horizontal frame below it: heading frame, z above the ground."""
        return np.array([0.0, 0.0, base.position[2]])

    def _state(self, base: Base) -> BodyState:
        """The centre of mass in the heading frame below the base."""
        to_heading = heading_matrix(base.yaw)
        centre = base.rotation @ self._body.centre
        rate = base.rotation @ base.gyro
        return BodyState(
            np.array([base.roll, base.pitch, 0.0]),
            centre @ to_heading + self._ground(base),
            rate @ to_heading,
            (base.velocity + cross(rate, centre)) @ to_heading,
        )

    def _reference(self, base: Base) -> BodyState:
        forward, leftward, yaw_rate = self._command.value
        later = self._end_of_step
        steps = len(later)
        yaw = wrap_angle(self._wanted_yaw - base.yaw) + yaw_rate * later
        cos, sin = np.cos(yaw), np.sin(yaw)
        velocity = np.stack(
            [cos * forward - sin * leftward, sin * forward + cos * leftward, np.zeros(steps)], axis=1
        )
        attitude, rate = np.zeros((steps, 3)), np.zeros((steps, 3))
        attitude[:, 2], rate[:, 2] = yaw, yaw_rate
        ahead = np.append(self._wanted_position - base.position[:2], 0.0) @ heading_matrix(base.yaw)
        position = ahead + np.cumsum(velocity, axis=0) * self._config.horizon.step_s
        position[:, 0] += cos * self._body.centre[0] - sin * self._body.centre[1]
        position[:, 1] += sin * self._body.centre[0] + cos * self._body.centre[1]
        position[:, 2] = self._wanted_height + self._body.centre[2]
        return BodyState(attitude, position, rate, velocity)

    def _path(self, state: BodyState, reference: BodyState) -> np.ndarray:
        """The centre of mass in the middle of each step: its speed decays to the reference's."""
        decay_s = 0.2
        time_s = self._middle_of_step[:, None]
        surplus = state.velocity - reference.velocity[0]
        path = state.position + reference.velocity[0] * time_s
        path += surplus * decay_s * (1.0 - np.exp(-time_s / decay_s))
        path[:, 2] = state.position[2]
        return path

    def _joint_command(self, observation: Observation, base: Base, pose: LegPose) -> JointCommand:
        config, up = self._config, base.rotation[2]
        swing = swing_target(
            self._clock.swing(), self._lift_off, self._landing(), config.gait.swing_s, config.swing
        )
        return self._leg_control.command(
            observation.sensed.joint_position,
            pose,
            self._stands,
            self._force @ base.rotation,
            self._wanted_velocity @ base.rotation,
            self._command.value[2] * up,
            up,
            self._swing_in_body(swing, base),
        )

    def _landing(self) -> np.ndarray:
        """Touch-down points of the feet's centres (legs, 3), world."""
        landing = self._target.copy()
        landing[:, 2] = self._legs.foot_radius - self._config.swing.depth_m
        return landing

    @staticmethod
    def _swing_in_body(target: SwingTarget, base: Base) -> SwingTarget:
        """A world-frame target as seen from the moving base."""
        position = (target.position - base.position) @ base.rotation
        velocity = (target.velocity - base.velocity) @ base.rotation - cross(base.gyro, position)
        return SwingTarget(position, velocity, target.acceleration @ base.rotation)
