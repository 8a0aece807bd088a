"""The MPC controller: forces for the feet that stand, trajectories for those that swing.

At the joint rate it follows the base by odometry, steps its clock and turns forces and swing trajectories
into joint commands; at `solve_hz` it plans the forces anew.
"""

import cmath
import time
from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.rotations import cross, heading_matrix, roll_pitch_yaw, rotation_matrix, wrap_angle
from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.gait import contact_trust
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.footholds import contact_points, foothold
from footfall.policies.controllers.mpc.legs import LegControl
from footfall.policies.controllers.mpc.problem import BodyState, ForceProblems
from footfall.policies.controllers.mpc.swing import swing_motion
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.solver import BoundedSolver
from footfall.policies.controllers.stance import nominal_feet
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import LegPose
from footfall.robots.rigid_body import nominal_body

_TIMINGS_KEPT = 100_000
_DECAY_S = 0.2  # within which the body's surplus speed is thought to be lost
_NO_SWING = np.empty((0, 3, 3))


class Base(NamedTuple):
    """The base as the controller sees it. World: where it was reset, z = 0 on the ground."""

    place: complex  # m, of the base's origin: x + i y
    height: float  # m
    velocity: np.ndarray  # (3,) m/s, world
    rotation: np.ndarray  # (3, 3) body to world
    gyro: np.ndarray  # (3,) rad/s, body
    roll: float
    pitch: float
    yaw: float

    @property
    def speed(self) -> complex:
        """The velocity's horizontal part, m/s."""
        x, y, _ = self.velocity.tolist()
        return complex(x, y)

    @property
    def position(self) -> np.ndarray:
        """Of the base's origin, (3,) m, world."""
        return np.array([self.place.real, self.place.imag, self.height])


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
        self._legs = robot.legs
        self._body = nominal_body(robot)
        self._problems = ForceProblems(self._body, config.horizon, config.weights, config.contact)
        self._solver = BoundedSolver()
        self._clock = config.gait.clock(robot)
        self._command = ShapedCommand(config.command)
        stance = config.stance
        self._places = nominal_feet(self._legs, stance.height_m, stance.outward_m, stance.shift_m)
        self._leg_control = LegControl(robot, self._legs, self._body, config)
        self._places_ahead = (self._places[:, 0] + 1j * self._places[:, 1]).tolist()
        self._radius = float(self._legs.foot_radius.mean())
        self._touch_down = np.zeros((self._legs.count, 3))  # of the feet's centres, from the ground
        self._touch_down[:, 2] = self._legs.foot_radius - config.swing.depth_m
        self._solve_every = max(1, round(config.rate_hz / config.horizon.solve_hz))
        steps, step_s = config.horizon.steps, config.horizon.step_s
        self._middle_of_step = step_s * (np.arange(steps) + 0.5)
        self._end_of_step = step_s * np.arange(1, steps + 1)
        decayed_s = _DECAY_S * (1.0 - np.exp(-self._middle_of_step / _DECAY_S))
        self._path_basis = np.column_stack([np.ones(steps), self._middle_of_step, decayed_s])
        self.solve_ms: deque[float] = deque(maxlen=_TIMINGS_KEPT)
        self._begin(0.0, stance.height_m)

    @property
    def notes(self) -> Sequence[str]:
        return ()

    @property
    def late(self) -> int:
        """Solves that daqp did not finish within its iterations."""
        return self._solver.fallbacks

    def reset(self, inputs: PolicyInput) -> None:
        yaw = roll_pitch_yaw(rotation_matrix(inputs.sensed.quaternion))[2]
        self._begin(yaw, self._above_ground(inputs))

    def _begin(self, yaw: float, height: float) -> None:
        count = self._legs.count
        self._clock.reset()
        self._command.reset()
        self._place = self._wanted_place = self._wanted_velocity = 0j
        self._wanted_yaw = yaw
        self._wanted_height = height
        self._force = np.tile([0.0, 0.0, GRAVITY_M_S2 * self._body.mass / count], (count, 1))
        self._stands = np.ones(count, dtype=bool)
        self._swinging: list[int] = []
        self._lift_off = np.zeros((count, 3))
        self._target = np.zeros((count, 3))
        self._ticks_to_solve = 0
        self._unsettled_s = 0.0

    def act(self, inputs: PolicyInput) -> JointCommand:
        dt_s = 1.0 / self.rate_hz
        base = self._follow(inputs, dt_s)
        pose = self._legs.pose(inputs.sensed.joint_position)
        self._step_clock(inputs, base, dt_s)
        self._lead(base, dt_s)

        stands, progress = self._clock.stance(), self._clock.swing().tolist()
        swinging = [leg for leg, stands_now in enumerate(stands.tolist()) if not stands_now]
        speed = base.speed
        for leg in swinging:
            self._set_target(leg, progress[leg], base, speed)
        self._ticks_to_solve -= 1
        if self._ticks_to_solve <= 0 or swinging != self._swinging:
            feet = base.position + pose.foot @ base.rotation.T
            lifting = [leg for leg in swinging if leg not in self._swinging]
            self._lift_off[lifting] = feet[lifting]
            self._swinging, self._stands = swinging, stands
            self._plan(base, feet)
            self._ticks_to_solve = self._solve_every

        return self._joints(inputs, base, pose, self._swing(swinging, progress, base))

    def _joints(self, inputs: PolicyInput, base: Base, pose: LegPose, swing: np.ndarray) -> JointCommand:
        """Joint commands that press with the planned forces and swing feet as planned (see `_swing`)."""
        up = base.rotation[2]
        velocity = np.array([self._wanted_velocity.real, self._wanted_velocity.imag, 0.0])
        return self._leg_control.command(
            inputs.sensed.joint_position,
            pose,
            self._force.dot(base.rotation),
            velocity.dot(base.rotation),
            self._command.value[2] * up,
            up,
            self._swinging,
            swing,
        )

    def stance(self) -> np.ndarray | None:
        if not self._clock.walking:
            return np.ones(self._legs.count)
        return contact_trust(self._clock.phases(), self._clock.timing.duty, edge=0.1)

    def _follow(self, inputs: PolicyInput, dt_s: float) -> Base:
        """The base's state; its place is dead reckoning, good for the length of a step."""
        rotation = rotation_matrix(inputs.sensed.quaternion)
        velocity = rotation.dot(inputs.base_velocity)
        x, y, _ = velocity.tolist()
        self._place += complex(x, y) * dt_s
        roll, pitch, yaw = roll_pitch_yaw(rotation)
        height = self._above_ground(inputs)
        return Base(self._place, height, velocity, rotation, inputs.sensed.gyro, roll, pitch, yaw)

    def _above_ground(self, inputs: PolicyInput) -> float:
        return inputs.base_height + self._radius

    def _step_clock(self, inputs: PolicyInput, base: Base, dt_s: float) -> None:
        settled = inputs.time_s >= self._config.settle_s
        if settled:
            self._command.advance(inputs.command, dt_s)
        walk = self._command.wants_walk(inputs.command) or self._unsettled(base, dt_s)
        self._clock.advance(dt_s, settled and walk)

    def _unsettled(self, base: Base, dt_s: float) -> bool:
        """Whether a robot that was told to stand had better step, as after a push."""
        restart = self._config.restart
        walking = self._clock.walking
        speed = abs(base.speed)
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
        forward, leftward, yaw_rate = self._command.value.tolist()
        self._wanted_velocity = complex(forward, leftward) * cmath.rect(1.0, base.yaw)
        ahead = self._wanted_place + self._wanted_velocity * dt_s - base.place
        most = stance.most_position_lead_m
        self._wanted_place = base.place + (ahead if abs(ahead) <= most else ahead * (most / abs(ahead)))
        turned = wrap_angle(self._wanted_yaw + yaw_rate * dt_s - base.yaw)
        most = stance.most_yaw_lead_rad
        self._wanted_yaw = base.yaw + min(most, max(-most, turned))
        climb = stance.height_m - self._wanted_height
        self._wanted_height += min(1.0, dt_s / self._config.settle_s) * climb

    def _set_target(self, leg: int, progress: float, base: Base, speed: complex) -> None:
        """Where a leg that swings should touch down; `speed` is the base's."""
        gait = self._clock.timing
        target = foothold(
            self._places_ahead[leg],
            base.place,
            base.height,
            speed,
            self._wanted_velocity,
            base.yaw,
            float(self._command.value[2]),
            (1.0 - progress) * gait.swing_s,
            gait.stance_s,
            self._config.foothold,
        )
        self._target[leg, 0], self._target[leg, 1] = target.real, target.imag

    def _swing(self, swinging: list[int], progress: list[float], base: Base) -> np.ndarray:
        """Motion of swinging feet as seen from the moving base, (k, 3, 3): see `LegControl.command`."""
        if not swinging:
            return _NO_SWING
        config, swing_s = self._config.swing, self._clock.timing.swing_s
        lift_off, landing = self._lift_off.tolist(), (self._target + self._touch_down).tolist()
        motion = np.array(
            [
                swing_motion(progress[leg], lift_off[leg], landing[leg], swing_s, config.height_m)
                for leg in swinging
            ]
        )
        position = [base.place.real, base.place.imag, base.height]
        motion -= np.array([position, base.velocity.tolist(), [0.0, 0.0, 0.0]])
        motion = motion.reshape(-1, 3).dot(base.rotation).reshape(-1, 3, 3)
        motion[:, 1] -= cross(base.gyro, motion[:, 0])
        return motion

    def _plan(self, base: Base, feet: np.ndarray) -> None:
        """Solve for the feet's forces; where that fails, keep the last ones of the feet that still stand."""
        began = time.perf_counter()
        contacts = self._clock.planned_stance(self._middle_of_step)
        contacts[0] = self._stands
        to_heading = heading_matrix(base.yaw)
        state, reference = self._state(base, to_heading), self._reference(base)
        points = np.array([feet, self._target]) - base.position
        points[:, :, 2] = 0.0  # on the ground
        present, targets = points @ to_heading
        centre = self._path(state, reference)
        arms = contact_points(contacts, present, targets, self._places, centre, reference.pose[:, 2])
        problem = self._problems.build(state, reference, contacts, arms, self._force.dot(to_heading))
        solution = self._solver.solve(problem)
        if solution is None:
            self._force = self._force * self._stands[:, None]
        else:
            force = self._problems.forces(solution, problem, self._legs.count)
            self._force = force.dot(to_heading.T)
        self.solve_ms.append(1e3 * (time.perf_counter() - began))

    def _state(self, base: Base, to_heading: np.ndarray) -> BodyState:
        """The centre of mass in the heading frame on the ground below the base."""
        centre = base.rotation @ self._body.centre
        rate = base.rotation @ base.gyro
        vectors = np.array([centre, rate, base.velocity + cross(rate, centre)]).dot(to_heading)
        x, y, z = vectors[0].tolist()
        return BodyState(np.array([base.roll, base.pitch, 0.0, x, y, z + base.height]), vectors[1:].ravel())

    def _reference(self, base: Base) -> BodyState:
        """The commanded motion after each step of the horizon, from the wanted pose on."""
        forward, leftward, yaw_rate = self._command.value.tolist()
        later = self._end_of_step
        yaw = wrap_angle(self._wanted_yaw - base.yaw) + yaw_rate * later
        heading = np.exp(1j * yaw)
        velocity = heading * complex(forward, leftward)
        ahead = (self._wanted_place - base.place) * cmath.rect(1.0, -base.yaw)
        centre_x, centre_y, centre_z = self._body.centre.tolist()
        place = ahead + velocity.cumsum() * self._config.horizon.step_s
        place += heading * complex(centre_x, centre_y)
        pose, rate = np.zeros((len(later), 6)), np.zeros((len(later), 6))
        pose[:, 2], rate[:, 2] = yaw, yaw_rate
        pose[:, 3], pose[:, 4] = place.real, place.imag
        rate[:, 3], rate[:, 4] = velocity.real, velocity.imag
        pose[:, 5] = self._wanted_height + centre_z
        return BodyState(pose, rate)

    def _path(self, state: BodyState, reference: BodyState) -> np.ndarray:
        """The centre of mass (steps, 3) in the middle of each step: its speed decays to the reference's."""
        (x, y, z), (forward, leftward, _) = state.pose[3:].tolist(), state.rate[3:].tolist()
        wanted_x, wanted_y, _ = reference.rate[0, 3:].tolist()
        rows = [[x, y, z], [wanted_x, wanted_y, 0.0], [forward - wanted_x, leftward - wanted_y, 0.0]]
        return self._path_basis.dot(np.array(rows))
