"""The gait generator as a controller: any named gait, on any robot whose feet it fits."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from footfall.common.rotations import rotation_matrix, wrap_angle, yaw_of
from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.gait import GaitConfig, GaitTiming
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.slope import Slope
from footfall.policies.controllers.stance import nominal_feet
from footfall.policies.controllers.walk.config import StrideConfig, WalkConfig
from footfall.policies.controllers.walk.feet import FootCycle
from footfall.policies.controllers.walk.foot import Footing, rolling_of
from footfall.policies.controllers.walk.ground import GroundForce, weight_torque
from footfall.policies.controllers.walk.levelling import Levelling
from footfall.policies.controllers.walk.limits import SteadyWalk, WalkLimits
from footfall.policies.controllers.walk.live import ATTITUDE, all_gaits, applied, changed_step, live_settings
from footfall.policies.controllers.walk.pacing import Pacing
from footfall.policies.controllers.walk.sway import Sway, SwayPlan, plan_sway
from footfall.policies.live_settings import Applied, Span, approached
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot
from footfall.robots.rigid_body import nominal_body

_PERIOD_RATE = 0.1  # s of the gait's period in each second
_FAR, _TOO_FAR = 0.6, 0.9  # of a step's length, from which on a foot slows the body down, and stops it
_ROOM_RATE = 5.0  # 1/s, how fast it does
_NO_SWAY = np.zeros(2, complex)
_APPROACH = 2.0  # cycles in which a gait with a sway comes to its longest steps at best
_SHIFTED_M = 0.002  # a body that is as near as this to its sway is ready for the first step
_STILL_M = 1e-4  # a sway below this is none
_ASTRAY_M = 0.01  # a robot that has come to rest brings feet farther away than this to their places


class Walk:
    """Position control of all joints: feet that stand carry the body at the commanded velocity.

    `change` asks for another gait or other steps while it walks. `notes` says once for each gait how limits
    changed what was asked for.
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
        self._centre = body.centre
        down = config.touch_down
        self._ground = None if down is None else GroundForce(robot, body, down.filter_s, down.inertia_doubt)
        self._footing = self._stand(config)
        farthest_m = float(np.hypot(*self._footing.places[:, :2].T).max())
        self._pacing = Pacing(WalkLimits(robot, body.centre[:2], config.limits), farthest_m)
        clock = config.gait.clock(robot)
        self._cycle = FootCycle(self._footing, clock.timing, clock.offsets)
        self._sway, self._levelling = Sway(), Levelling(config.levelling)
        self._slope = Slope(config.slope)
        self._command = ShapedCommand(config.command)
        self._no_torque = np.zeros(len(robot.joint_names))
        self._kp, self._kd = self._no_torque + config.kp, self._no_torque + config.kd
        self._most_step_rad = robot.description.target_rate_rad_s / config.rate_hz
        self.notes: list[str] = []
        self._all_gaits = all_gaits(robot, config)
        self.gaits = tuple(self._all_gaits)
        self._begin(robot.default_pose)

    def reset(self, inputs: PolicyInput) -> None:
        self._begin(inputs.sensed.joint_position.copy())
        if self._ground is not None:
            self._ground.reset(inputs.sensed)

    def _begin(self, joint_position: np.ndarray) -> None:
        clock = self._config.gait.clock(self._robot)
        self._cycle.begin(clock.timing, clock.offsets)
        for part in (self._cycle, self._command, self._levelling, self._slope, self._sway, self._pacing):
            part.reset()
        self._start = self._previous = joint_position
        self._step, self._gait = self._config.step, self._config.gait
        self._wanted_gait = self._gait
        self._height_m = self._step.body_height_m
        self._sway_plan = self._plan_sway()
        self._steps, self._room = False, 1.0
        self._yaw: float | None = None  # that it keeps to, while it steps

    def change(self, gait: GaitConfig | None = None, step: StrideConfig | None = None) -> None:
        """Ask for another gait, or other steps, without a jump in a joint's target.

        A gait begins when all feet stand: those in the air land first. A step's height holds from the next
        lift-off, its length and the body's height are approached.

        Raises:
            UserError: there is no such gait for this robot.
        """
        if gait is not None:
            gait.clock(self._robot)
            self._wanted_gait = gait
        if step is not None and step != self._step:
            self._step = step
            self._pacing.look_again()

    @property
    def live_settings(self) -> dict[str, Span]:
        """See `Steerable`."""
        wanted = self._wanted_gait
        return live_settings(self._config, self._all_gaits.get(wanted.name, wanted).period_s)

    @property
    def applied(self) -> Applied:
        """See `Steerable`."""
        period_s, attitude = self._cycle.timing.period_s, self._levelling.attitude
        return applied(self._gait.name, period_s, self._step, self._height_m, attitude)

    def set_live(self, values: Mapping[str, float]) -> None:
        """See `Steerable` and `change`. The period and the attitude are approached."""
        self.change(step=changed_step(self._step, values))
        if "step_period_s" in values:
            same, span = self._wanted_gait == self._gait, self.live_settings["step_period_s"]
            period_s = min(max(values["step_period_s"], span.lowest), span.highest)
            self._wanted_gait = replace(self._wanted_gait, period_s=period_s)
            self._gait = self._wanted_gait if same else self._gait
        named = zip(ATTITUDE, self._levelling.wanted.tolist(), strict=True)
        self._levelling.wanted = np.array([values.get(name, now) for name, now in named])

    def take_up(self, gait: str) -> None:
        """See `Steerable`. The gait begins with its own period."""
        self.change(self._all_gaits[gait])

    def act(self, inputs: PolicyInput) -> JointCommand:
        config, dt_s = self._config, 1.0 / self.rate_hz
        sensed = inputs.sensed
        pose = self._legs.pose(sensed.joint_position)
        settled = inputs.time_s >= config.settle_s
        inputs = self._slope.follow(inputs, pose.foot, self._planned_stance(), dt_s)
        if settled:
            self._walk(inputs, dt_s)
        if self._ground is not None:
            pushed = self._ground.update(sensed, pose.jacobian, dt_s)
            if settled:
                self._meet_ground(pushed, pose.foot @ rotation_matrix(inputs.sensed.quaternion)[2], dt_s)

        most = config.levelling.body_rate_m_s * dt_s
        self._height_m += min(max(self._step.body_height_m - self._height_m, -most), most)
        goal = self._legs.scatter(self._legs.solve(self._tips(inputs, dt_s)), self._robot.default_pose)
        share = min(1.0, inputs.time_s / config.settle_s)
        wanted = self._start + share * (goal - self._start)
        # Steps of a steady walk keep to the limit by their tempo; those from one gait to another may not.
        before, most = self._previous, self._most_step_rad
        self._previous = position = np.minimum(np.maximum(wanted, before - most), before + most)
        velocity = (position - before) / dt_s
        weight = config.weight_n * self._slope.up(yaw_of(inputs.sensed.quaternion.tolist()))
        held = weight_torque(self._legs, pose.jacobian, ~self._cycle.swings, weight)
        torque = self._legs.scatter(held, self._no_torque)
        return JointCommand(position, velocity, self._kp, self._kd, torque)

    def stance(self) -> np.ndarray | None:
        return self._planned_stance()

    def _planned_stance(self) -> np.ndarray:
        return self._cycle.stance() if self._steps else np.ones(self._legs.count)

    def footholds(self) -> np.ndarray:
        return self._cycle.footholds(self._sway.at(self._cycle.clock), self._height_m)

    def _stand(self, config: WalkConfig) -> Footing:
        legs, stance = self._legs, config.stance
        places = nominal_feet(legs, config.step.body_height_m, stance.outward_m, stance.shift_m)
        return Footing(places * [1.0, 1.0, 0.0], rolling_of(legs, places, self._robot.default_pose))

    def _walk(self, inputs: PolicyInput, dt_s: float) -> None:
        """Let feet stand, swing, lift off and land as the command wants it.

        With a sway the weight is shifted before the first foot lifts off, and back after the last has landed.
        """
        cycle, command = self._cycle, self._command
        wanted = self._within_limits(inputs.command)
        plan = self._sway_plan
        ready = self._steps or self._sway.misses(plan.body) < _SHIFTED_M
        command.advance(wanted if ready else np.zeros(3), self._calm(dt_s))
        walk = command.wants_walk(wanted)
        if self._wanted_gait != self._gait and not cycle.flies:
            self._take_up_gait()
        if cycle.timing.period_s != self._gait.period_s:
            self._approach_period(dt_s)
        astray = cycle.astray(_ASTRAY_M)
        changes = self._wanted_gait != self._gait
        lift_off = [not changes and (walk or away) for away in astray]
        if walk:
            self._pacing.set_tempo(self._command.value.tolist() == wanted.tolist(), dt_s)
        wants = walk or cycle.flies or any(lift_off)
        goal = plan.body if wants else _NO_SWAY
        self._sway.approach(goal, self._pacing.tempo * dt_s / cycle.timing.period_s)
        self._steps = ready and (wants or self._sway.misses(_NO_SWAY) > _STILL_M)
        if self._steps:
            passed_s = self._pacing.tempo * dt_s
            forward, leftward, yaw_rate = self._with_room(dt_s)
            yaw_rate += self._turn_back(inputs, yaw_rate * passed_s)
            cycle.advance([forward, leftward, yaw_rate], passed_s, self._step.height_m, lift_off)
        else:
            self._yaw = None
            cycle.clock = plan.start(cycle.clock)

    def _calm(self, dt_s: float) -> float:
        """How long a command is approached for in a tick: with a sway, no faster than in some cycles.

        Feet whose first swing comes last would be carried so far out meanwhile that the weight left them.
        """
        if not any(self._sway_plan.body.tolist()):
            return dt_s
        timing, most = self._cycle.timing, self._config.command.acceleration_m_s2
        calm = self._step.length_m / (timing.stance_s * _APPROACH * timing.period_s)
        return dt_s * min(1.0, calm / most)

    def _with_room(self, dt_s: float) -> list[float]:
        """The velocity now, less where a foot that waits for its swing is carried too far meanwhile.

        A steady walk carries feet half a step's length out of their places; others come with new commands,
        other steps and other gaits.
        """
        velocity, length = self._command.value.tolist(), self._step.length_m
        room = (_TOO_FAR - self._cycle.carried(velocity) / length) / (_TOO_FAR - _FAR)
        most = _ROOM_RATE * dt_s
        self._room += min(max(min(max(room, 0.0), 1.0) - self._room, -most), most)
        return [self._room * part for part in velocity]

    def _turn_back(self, inputs: PolicyInput, turned: float) -> float:
        """Yaw rate, rad/s, towards the heading that commands led to, which have turned it a bit further."""
        config, yaw = self._config.heading, yaw_of(inputs.sensed.quaternion.tolist())
        ahead = 0.0 if self._yaw is None else wrap_angle(self._yaw - yaw)
        ahead = min(max(ahead, -config.most_rad), config.most_rad)
        self._yaw = yaw + ahead + turned
        return config.gain * ahead

    def _tips(self, inputs: PolicyInput, dt_s: float) -> np.ndarray:
        """Where the tips should be, (legs, 3) m, base frame."""
        feet = self._cycle.feet
        feet[:, :2] -= self._sway.at(self._cycle.clock)
        downhill = self._slope.downhill(yaw_of(inputs.sensed.quaternion.tolist()), self._height_m)
        feet[:, :2] += downhill.real, downhill.imag
        feet[:, 2] -= self._below()
        return self._levelling.apply(feet, inputs, dt_s)

    def _below(self) -> np.ndarray:
        return self._height_m - self._legs.foot_radius

    def _within_limits(self, command: np.ndarray) -> np.ndarray:
        """The command that the walk can follow; once for each gait a note says what is left out."""
        stance_s, length_m = self._cycle.timing.stance_s, self._step.length_m
        within = self._pacing.within(command, stance_s, length_m, self._steady)
        reason, gait = self._pacing.reason, self._gait.name
        if reason and not any(note.startswith(f"{gait}: ") for note in self.notes):
            self.notes.append(f"{gait}: {reason}")
        return within

    def _steady(self, velocity: np.ndarray) -> SteadyWalk:
        """The present walk at a steady velocity (3,)."""
        cycle, height_m = self._cycle, self._step.height_m
        footing, timing, offsets = self._footing, cycle.timing, cycle.offsets
        return SteadyWalk(footing, timing, offsets, velocity, height_m, self._sway_plan, self._below())

    def _take_up_gait(self) -> None:
        self._gait = self._wanted_gait
        clock = self._gait.clock(self._robot)
        self._cycle.begin_anew(clock.timing, clock.offsets, self._command.value.tolist())
        self._sway_plan = self._plan_sway()
        self._pacing.look_again()

    def _approach_period(self, dt_s: float) -> None:
        """Change the period slowly: the clock goes on, and so does each foot on its way."""
        timing = self._cycle.timing
        period_s = approached(timing.period_s, self._gait.period_s, _PERIOD_RATE * dt_s)
        self._cycle.timing = GaitTiming(period_s, timing.duty)
        if period_s == self._gait.period_s:
            self._sway_plan = self._plan_sway()
            self._pacing.look_again()

    def _plan_sway(self) -> SwayPlan:
        """The sway of the present gait."""
        cycle, height_m = self._cycle, self._step.body_height_m + float(self._centre[2])
        places, share = self._footing.places[:, :2], self._config.stance.sway
        return plan_sway(places, cycle.timing, cycle.offsets, height_m, share)

    def _meet_ground(self, pushed: np.ndarray, height: np.ndarray, dt_s: float) -> None:
        """Feet that meet the ground early stand; feet that should stand and do not are lowered a little.

        Args:
            pushed: (feet,) share of an even part of the weight with which the ground pushes each up.
            height: (feet,) m, of the tips along the ground's normal, from wherever.
            dt_s: how long the latter are lowered.
        """
        config, cycle = self._config.touch_down, self._cycle
        assert config is not None
        least, enough = config.force_share
        cycle.touch_down((pushed > enough) & (cycle.progress > config.from_progress), height)
        cycle.lower(pushed < least, config.probe_m_s * dt_s, -config.probe_m)
