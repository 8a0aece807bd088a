"""The gait generator as a controller: any named gait, on any robot whose feet it fits."""

import numpy as np

from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.gait import GaitConfig, contact_trust
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import level_feet, tilt_correction
from footfall.policies.controllers.walk.config import StepConfig, WalkConfig
from footfall.policies.controllers.walk.feet import FootCycle
from footfall.policies.controllers.walk.limits import Pace, SteadyWalk, WalkLimits
from footfall.policies.policy import Observation
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.rigid_body import nominal_body

_CHANGE = np.array([0.005, 0.005, 0.02])  # of the velocity, after which the limits are looked at again
_TEMPO_RATE = 0.5  # 1/s, how fast the tempo may rise; it falls at once
_REGULAR = 1e-5 * np.eye(3)  # m^2/rad^2
_GRAVITY = 9.81


class Walk:
    """Position control of all joints: feet that stand carry the body at the commanded velocity.

    `change` asks for another gait or other steps while it walks. `notes` says once for each gait what the
    limits made of what was asked for.
    """

    needs_estimate = False
    contract = None

    def __init__(self, robot: Robot, name: str, config: WalkConfig | None = None) -> None:
        """`name` is that of the controller, whose settings are used where none are given."""
        self.name = name
        self._config = config = config or controller_settings(robot, name, WalkConfig)
        self.rate_hz = config.rate_hz
        self._robot, self._legs = robot, robot.legs
        body = nominal_body(robot)
        self._leg_inertia = body.leg_inertia
        self._even_force = _GRAVITY * body.mass / self._legs.count
        centre = (float(body.centre[0]), float(body.centre[1]))
        self._limits = WalkLimits(robot, centre, config.limits.rate_share, config.limits.margin_m)
        self._places = self._legs.default_foot.copy()
        self._places[:, 2] = 0.0
        clock = config.gait.clock(robot)
        self._cycle = FootCycle(self._places, clock.timing, clock.offsets)
        self._command = ShapedCommand(config.command)
        self._kp = np.full(len(robot.joint_names), config.kp)
        self._kd = np.full(len(robot.joint_names), config.kd)
        self.notes: list[str] = []
        self._begin(robot.default_pose)

    def reset(self, observation: Observation) -> None:
        self._begin(observation.sensed.joint_position.copy())

    def _begin(self, joint_position: np.ndarray) -> None:
        clock = self._config.gait.clock(self._robot)
        self._cycle.begin(clock.timing, clock.offsets)
        self._cycle.reset()
        self._command.reset()
        self._start = self._previous = joint_position
        self._velocity = self._acceleration = np.zeros_like(joint_position)
        self._tilt = np.zeros(2)
        self._step, self._gait = self._config.step, self._config.gait
        self._wanted_gait = self._gait
        self._height_m = self._step.body_height_m
        self._pace, self._tempo = Pace(), 1.0
        self._looked_at: np.ndarray | None = None

    def change(self, gait: GaitConfig | None = None, step: StepConfig | None = None) -> None:
        """Ask for another gait, or other steps, without a jump in a joint's target.

        A gait begins when all feet stand: those in the air land first. A step's height holds from the next
        lift-off, its length and the body's height are approached.

        Raises:
            UserError: there is no such gait for this robot.
        """
        if gait is not None:
            gait.clock(self._robot)
            self._wanted_gait = gait
        if step is not None:
            self._step, self._looked_at = step, None

    def act(self, observation: Observation) -> JointCommand:
        config, dt_s = self._config, 1.0 / self.rate_hz
        cycle, sensed = self._cycle, observation.sensed
        settled = observation.time_s >= config.settle_s
        pose = self._legs.pose(sensed.joint_position)
        wanted = self._within_steps(observation.command)
        if settled:
            self._command.advance(wanted, dt_s)
        walk = settled and self._command.wants_walk(wanted)
        if walk:
            self._look_at_limits(wanted)
        self._tempo = min(self._pace.tempo, self._tempo + _TEMPO_RATE * dt_s)
        if self._wanted_gait != self._gait:
            walk = False
            if not cycle.swings.any():
                self._take_up_gait()
        if walk or cycle.swings.any():
            velocity = self._pace.stride * self._command.value
            cycle.advance(velocity, self._tempo * dt_s, self._step.height_m, lift_off=walk)
            self._feel_ground(pose.jacobian, sensed.joint_torque, dt_s)

        most = config.levelling.body_rate_m_s * dt_s
        self._height_m += min(max(self._step.body_height_m - self._height_m, -most), most)
        goal = self._legs.scatter(self._legs.solve(self._tips(observation, dt_s)), self._robot.default_pose)
        share = min(1.0, observation.time_s / config.settle_s)
        wanted_position = self._start + share * (goal - self._start)
        # Steps of a steady walk keep to the limit by their tempo; those from one gait to another may not.
        step = self._robot.description.target_rate_rad_s * dt_s
        position = np.minimum(np.maximum(wanted_position, self._previous - step), self._previous + step)
        velocity = (position - self._previous) / dt_s
        self._previous = position
        self._acceleration, self._velocity = (velocity - self._velocity) / dt_s, velocity
        torque = self._legs.scatter(self._weight_torque(pose.jacobian), np.zeros_like(position))
        return JointCommand(position, velocity, self._kp, self._kd, torque)

    def stance(self) -> np.ndarray | None:
        cycle = self._cycle
        phases = cycle.phases()
        trust = contact_trust(phases, cycle.timing.duty, edge=0.1)
        waits = phases >= cycle.timing.duty
        return np.where(cycle.swings, 0.0, np.where(waits, 1.0, trust))

    def _tips(self, observation: Observation, dt_s: float) -> np.ndarray:
        """Where the tips should be, (legs, 3) m, base frame."""
        levelling = self._config.levelling
        tilt = tilt_correction(observation, levelling.gain, levelling.rate_gain_s, levelling.most_rad)
        self._tilt += min(1.0, dt_s / levelling.filter_s) * (tilt - self._tilt)
        feet = self._cycle.feet.copy()
        feet[:, 2] -= self._below()
        return level_feet(feet, self._tilt)

    def _below(self) -> np.ndarray:
        return self._height_m - self._legs.foot_radius

    def _within_steps(self, command: np.ndarray) -> np.ndarray:
        """The command as far as no foot is carried back farther than a step's length in one stance."""
        turning = np.abs(command[2]) * np.hypot(self._places[:, 0], self._places[:, 1]).max()
        carried = (float(np.hypot(command[0], command[1])) + turning) * self._cycle.timing.stance_s
        return command * min(1.0, self._step.length_m / max(carried, 1e-9))

    def _look_at_limits(self, wanted: np.ndarray) -> None:
        """Find the pace for a wanted velocity, or for a higher one of now, and note what it costs."""
        present = self._command.value
        velocity = wanted if wanted @ wanted >= present @ present else present
        if self._looked_at is not None and np.all(np.abs(velocity - self._looked_at) < _CHANGE):
            return
        self._looked_at = velocity.copy()
        cycle = self._cycle
        self._pace = self._limits.pace(
            SteadyWalk(
                self._places, cycle.timing, cycle.offsets, velocity, self._step.height_m, self._below()
            )
        )
        if self._pace.reason and not any(note.startswith(f"{self._gait.name}: ") for note in self.notes):
            self.notes.append(f"{self._gait.name}: {self._pace.reason}")

    def _take_up_gait(self) -> None:
        self._gait = self._wanted_gait
        clock = self._gait.clock(self._robot)
        self._cycle.begin(clock.timing, clock.offsets)
        self._looked_at = None

    def _feel_ground(self, jacobian: np.ndarray, torque: np.ndarray, dt_s: float) -> None:
        """Feet that meet the ground early stand; feet that should stand and do not are lowered a little.

        Torque beyond that of the legs' own inertia comes from the feet. Without taking that off, a leg
        slowing down at the end of its swing would look like one on the ground.
        """
        config, cycle, gather = self._config.touch_down, self._cycle, self._legs.gather
        inertial = self._leg_inertia @ gather(self._acceleration)[:, :, None]
        pushed = jacobian @ (gather(torque)[:, :, None] - inertial)
        regular = jacobian @ jacobian.transpose(0, 2, 1) + _REGULAR
        upward = -np.linalg.solve(regular, pushed)[:, 2, 0]
        touches = upward > config.force_share * self._even_force
        cycle.touch_down(touches & (cycle.progress > config.from_progress))
        cycle.lower(~touches, config.probe_m_s * dt_s, -config.probe_m)

    def _weight_torque(self, jacobian: np.ndarray) -> np.ndarray:
        """Joint torques (legs, m) that share the weight among the feet that stand, N m."""
        stands = ~self._cycle.swings
        force = np.zeros((self._legs.count, 3))
        force[:, 2] = stands * (self._config.weight_n / max(1, int(stands.sum())))
        return self._legs.torque(jacobian, force)
