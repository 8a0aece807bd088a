"""The MPC controller: forces for stance feet, trajectories for swing feet.

At the joint rate it integrates odometry, advances its clock and turns forces and swing trajectories into
joint commands. At `solve_hz` it computes new forces.
"""

import time
from collections.abc import Mapping, Sequence

import numpy as np

from footfall.common.errors import UserError, naming
from footfall.common.rotations import cross, heading_matrix, roll_pitch_yaw, rotation_matrix
from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.gait import contact_trust
from footfall.policies.controllers.lookahead import Lookahead
from footfall.policies.controllers.mpc.base import (
    Base,
    BaseFollower,
    Disturbance,
    body_state,
    capture_offset_m,
)
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.footholds import contact_points
from footfall.policies.controllers.mpc.forces import ForcePlanner
from footfall.policies.controllers.mpc.grip import Grip
from footfall.policies.controllers.mpc.legs import LegControl
from footfall.policies.controllers.mpc.live import LiveMpc
from footfall.policies.controllers.mpc.reference import Reference
from footfall.policies.controllers.mpc.swing_feet import SwingFeet
from footfall.policies.controllers.mpc.wrenches import Wrenches
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.slope import Slope
from footfall.policies.controllers.stance import nominal_feet, require_in_reach, require_lift
from footfall.policies.live_settings import Applied, Span
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.kinematics import LegPose, Legs
from footfall.robots.rigid_body import nominal_body


class Mpc:
    """Convex model-predictive control with Raibert footholds and swing impedance.

    Attributes:
        stands: planned contact of each foot, (feet,) boolean.
    """

    name = "mpc"
    needs_estimate = True
    contract = None

    def __init__(self, robot: Robot, config: MpcConfig | None = None) -> None:
        self._config = config = config or controller_settings(robot, self.name, MpcConfig)
        self.rate_hz = config.rate_hz
        self._robot = robot
        if config.foothold.catch is not None and self._legs.count != 2:
            raise UserError(f"robot '{robot.name}' cannot use foothold.catch: the robot must have two feet")
        self._body = nominal_body(robot)
        self.forces = ForcePlanner(robot, self._body, config)
        self._grip = Grip(self._legs, config.contact)
        self._lookahead = Lookahead(robot.motor, 1.0 / config.rate_hz)
        with naming("gait.name"):
            self.clock = config.gait.clock(robot)
        self.command = ShapedCommand(config.command)
        stance = config.stance
        positions = nominal_feet(self._legs, stance.height_m, stance.outward_m, stance.shift_m)
        lengths = {f"stance.{name}": getattr(stance, name) for name in ("height_m", "outward_m", "shift_m")}
        require_in_reach(robot, positions, lengths)
        require_lift(robot, "swing.height_m", config.swing.height_m)
        require_lift(robot, "swing.depth_m", config.swing.depth_m)
        self._leg_control = LegControl(robot, self._legs, self._body, config)
        self.slope = Slope(config.slope)
        self.follower = BaseFollower(float(self._legs.foot_radius.mean()))
        self._disturbance = Disturbance(config.restart)
        self.reference = Reference(config, self._body.centre)
        self.swing_feet = SwingFeet(config, positions, self._legs.foot_radius, self._body.centre)
        self._live = LiveMpc(robot, config)
        self._begin(0.0, stance.height_m)

    @property
    def notes(self) -> Sequence[str]:
        return ()

    @property
    def gaits(self) -> Sequence[str]:
        """See `Steerable`."""
        return self._config.gaits

    @property
    def live_settings(self) -> Mapping[str, Span]:
        """See `Steerable`."""
        return self._live.spans

    @property
    def wrenches(self) -> Wrenches:
        """Planned wrench of each foot, world."""
        return self.forces.wrenches

    @property
    def force(self) -> np.ndarray:
        """Planned force on each foot, (feet, 3) N, world."""
        return self.forces.wrenches.force

    @property
    def solve_ms(self) -> Sequence[float]:
        """Duration of each build and solve."""
        return self.forces.solve_ms

    @property
    def fallbacks(self) -> int:
        """Number of solves that daqp did not finish within its iteration limit."""
        return self.forces.solver.fallbacks

    @property
    def _legs(self) -> Legs:
        return self._robot.legs

    def reset(self, inputs: PolicyInput) -> None:
        yaw = roll_pitch_yaw(rotation_matrix(inputs.sensed.quaternion))[2]
        self._begin(yaw, self.follower.height(inputs))

    def _begin(self, yaw: float, height: float) -> None:
        count = self._legs.count
        self._lookahead.reset()
        self._grip.reset()
        self._live.reset()
        gait = self._config.gait.clock(self._robot)
        self.clock.timing, self.clock.offsets = gait.timing, gait.offsets
        self.clock.reset()
        self.command.reset()
        self.slope.reset()
        self.follower.reset()
        self._disturbance.reset()
        self.reference.begin(yaw, height)
        self.swing_feet.reset()
        self.swing_feet.height_m = self._config.swing.height_m
        self.forces.reset()
        self.stands, self._planned = np.ones(count, dtype=bool), self._planned_stance()
        self._swinging: list[int] = []
        self._ticks_to_solve = 0

    @property
    def applied(self) -> Applied:
        """See `Steerable`."""
        return self._live.applied

    def set_live(self, values: Mapping[str, float]) -> None:
        """See `Steerable`."""
        self._live.request(values)

    def take_up(self, gait: str) -> None:
        """See `Steerable`. Feet in the air land first."""
        self._live.next_gait = gait

    def act(self, inputs: PolicyInput) -> JointCommand:
        dt_s = 1.0 / self.rate_hz
        inputs = self._lookahead.predict(inputs)
        pose = self._legs.pose(inputs.sensed.joint_position)
        inputs = self.slope.follow(inputs, pose.foot, self._planned, dt_s)
        base = self.follower.follow(inputs, dt_s)
        self._advance_clock(inputs, base, pose, dt_s)
        self._planned = planned = self._planned_stance()
        self._grip.follow(inputs.sensed, pose, base.rotation[2], planned, dt_s)
        self.reference.advance(base, self.command.value, dt_s)

        self.swing_feet.shift = self.slope.downhill(base.yaw, base.height)
        stands, progress = self.clock.stance(), self.clock.swing().tolist()
        swinging = [leg for leg, in_stance in enumerate(stands.tolist()) if not in_stance]
        for leg in swinging:
            self.swing_feet.aim(
                leg,
                progress[leg],
                base,
                pose,
                self.wrenches,
                self.reference.velocity,
                float(self.command.value[2]),
                self.clock.timing,
            )
        self._ticks_to_solve -= 1
        if self._ticks_to_solve <= 0 or swinging != self._swinging:
            feet = base.position + pose.foot @ base.rotation.T
            lifting = [leg for leg in swinging if leg not in self._swinging]
            self.swing_feet.lift_off[lifting] = feet[lifting]
            self._swinging, self.stands = swinging, stands
            self._plan(base, feet, self._leg_rotation(inputs))
            self._ticks_to_solve = max(1, round(self.rate_hz / self._config.horizon.solve_hz))

        swing = self.swing_feet.motion(swinging, progress, base, self.clock.timing.swing_s)
        command = self._joints(inputs, base, pose, swing)
        self._lookahead.record(command, self._acceleration(base, pose), planned)
        return command

    def _leg_rotation(self, inputs: PolicyInput) -> np.ndarray:
        """Angular velocity (3,) rad/s, base frame, of the whole robot minus that of the base.

        It is due to the motion of the legs: a leg that swings forward in flight turns the base backward.
        """
        if not self._config.legs_turn_base:
            return np.zeros(3)
        rates = self._legs.gather(inputs.sensed.joint_velocity)
        momentum = (self._body.leg_momentum @ rates[:, :, None]).sum(axis=0)[:, 0]
        return self._body.inverse_inertia @ momentum

    def _acceleration(self, base: Base, pose: LegPose) -> np.ndarray:
        """Acceleration of the base by the planned forces, linear and angular, (6,) m/s^2 and rad/s^2,
        world."""
        body = self._body
        wrenches = self.wrenches.dot(base.rotation)
        angular = body.inverse_inertia @ wrenches.about(pose.foot - body.centre)
        linear = np.add.reduce(wrenches.force) / body.mass - cross(angular, body.centre)
        acceleration = np.array([linear, angular]).dot(base.rotation.T)
        acceleration[0] += self.slope.gravity
        return acceleration.dot(self.slope.axes.T).ravel()

    def _joints(self, inputs: PolicyInput, base: Base, pose: LegPose, swing: np.ndarray) -> JointCommand:
        """Joint commands for the planned forces and the motion of the swing feet (`SwingFeet.motion`)."""
        up = base.rotation[2]
        desired = self.reference.velocity
        velocity = np.array([desired.real, desired.imag, 0.0])
        return self._leg_control.command(
            inputs.sensed.joint_position,
            pose,
            self.force.dot(base.rotation),
            velocity.dot(base.rotation),
            self.command.value[2] * up,
            up,
            self._swinging,
            swing,
        )

    def stance(self) -> np.ndarray | None:
        expected = self._lookahead.stance()
        return self._planned if expected is None else expected

    def footholds(self) -> np.ndarray:
        return self.swing_feet.footholds(self.slope.axes)

    def _planned_stance(self) -> np.ndarray:
        if not self.clock.walking:
            return np.ones(self._legs.count)
        return contact_trust(self.clock.phases(), self.clock.timing.duty, edge=0.1)

    def _advance_clock(self, inputs: PolicyInput, base: Base, pose: LegPose, dt_s: float) -> None:
        settled = inputs.time_s >= self._config.settle_s
        if settled:
            self.command.advance(inputs.command, dt_s)
        walking = self.clock.walking
        offset_m = 0.0 if walking else capture_offset_m(base, self._body.centre, pose.foot)
        disturbed = self._disturbance.active(base, walking, offset_m, dt_s)
        walk = self.command.requests_walk(inputs.command) or disturbed
        self._live.advance(self.clock, self.reference, self.swing_feet, dt_s)
        if self._live.next_gait and not self.clock.walking:
            self._live.change_gait(self.clock)
        self.clock.advance(dt_s, settled and walk and not self._live.next_gait)

    def _plan(self, base: Base, feet: np.ndarray, leg_rotation: np.ndarray) -> None:
        """Solve for the feet's forces; if that fails, keep the previous forces of the feet in stance."""
        began = time.perf_counter()
        contacts = self.clock.planned_stance(self.reference.middle_of_step)
        contacts[0] = self.stands
        to_heading = heading_matrix(base.yaw)
        state = body_state(base, self._body.centre, to_heading, leg_rotation)
        reference = self.reference.over_horizon(base, self.command.value)
        points = np.array([feet, self.swing_feet.target]) - base.position
        points[:, :, 2] = 0.0  # on the ground
        current, targets = points @ to_heading
        centre = self.reference.path(state, reference)
        arms = contact_points(
            contacts, current, targets, self.swing_feet.shifted_positions, centre, reference.pose[:, 2]
        )
        gravity = self.slope.gravity.dot(to_heading)
        friction = self._grip.friction(float(np.hypot(*self.slope.gradient)))
        self.forces.plan(state, reference, contacts, arms, to_heading, friction, gravity)
        self.forces.solve_ms.append(1e3 * (time.perf_counter() - began))
