"""Steps: which feet swing, and how the body moves and sways, according to the command."""

import numpy as np

from footfall.common.errors import naming
from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.stance import nominal_feet, require_in_reach, require_lift
from footfall.policies.controllers.walk.config import StrideConfig, WalkConfig
from footfall.policies.controllers.walk.feet import FootCycle
from footfall.policies.controllers.walk.foot import Footing, rolling_of
from footfall.policies.controllers.walk.heading import Heading
from footfall.policies.controllers.walk.limits import SteadyWalk, WalkLimits
from footfall.policies.controllers.walk.live import WalkSettings
from footfall.policies.controllers.walk.pacing import Pacing
from footfall.policies.controllers.walk.sway import Sway, SwayPlan, plan_sway
from footfall.policies.controllers.walk.travel import TravelLimit
from footfall.policies.live_settings import moved_towards
from footfall.robots.description import Robot

_PERIOD_RATE = 0.1  # change of the gait's period in s per second
_NO_SWAY = np.zeros(2, complex)
_APPROACH_CYCLES = 2.0  # shortest time, in cycles, in which a gait with a sway reaches its longest steps
_MAX_SWAY_ERROR_M = 0.002  # largest distance of the body from its sway at the first lift-off
_MIN_SWAY_M = 1e-4  # a smaller sway counts as none
_MAX_REST_ERROR_M = 0.01  # at rest, feet farther than this from mid-stance are moved there


class Stepping:
    """Feet and body of a walk. `notes` has one line per gait whose command was reduced by limits."""

    def __init__(self, robot: Robot, config: WalkConfig, settings: WalkSettings, centre: np.ndarray) -> None:
        """`centre` is the centre of mass (3,), m, relative to the base's origin."""
        self._config, self._settings, self._centre = config, settings, centre
        self._radius = robot.legs.foot_radius
        self.footing = footing_of(robot, config)
        farthest_m = float(np.hypot(*self.footing.positions[:, :2].T).max())
        self._pacing = Pacing(WalkLimits(robot, centre[:2], config.limits), farthest_m)
        with naming("gait.name"):
            clock = config.gait.clock(robot)
        self._own_gait = clock.timing, clock.offsets
        self.cycle = FootCycle(self.footing, *self._own_gait)
        self._sway, self.command = Sway(), ShapedCommand(config.command)
        self._heading, self._travel = Heading(config.heading), TravelLimit()
        self.notes: list[str] = []
        self.reset()

    def reset(self) -> None:
        """Place all feet at mid-stance, with the configuration's own gait."""
        self._settings.reset()
        self.cycle.begin(*self._own_gait)
        for part in (self.cycle, self.command, self._sway, self._pacing, self._heading, self._travel):
            part.reset()
        self.height_m = self._settings.step.body_height_m
        self._sway_plan = self._plan_sway()
        self.active = False  # whether feet step, or are about to

    def change_step(self, step: StrideConfig) -> None:
        """Change the dimensions of the steps."""
        if step != self._settings.step:
            self._settings.step = step
            self._pacing.invalidate()

    def stance(self) -> np.ndarray:
        """Trust in each foot's contact, (feet,)."""
        return self.cycle.stance() if self.active else np.ones(len(self.footing.positions))

    def footholds(self) -> np.ndarray:
        """Footholds of swing feet, (feet, 3) m, relative to the base; NaN for stance feet."""
        return self.cycle.footholds(self._sway.at(self.cycle.clock), self.height_m)

    def depth(self) -> np.ndarray:
        """Depth of each tip in stance below the base's origin, (feet,) m."""
        return self.height_m - self._radius

    def tips(self, shift: complex) -> np.ndarray:
        """Desired positions of the tips, (feet, 3) m, relative to a level base.

        `shift` moves all tips, m, x + i y.
        """
        (sway_x, sway_y), depth = self._sway.at(self.cycle.clock), self.depth().tolist()
        return np.array(
            [
                (foot.x - sway_x + shift.real, foot.y - sway_y + shift.imag, foot.z - depth_m)
                for foot, depth_m in zip(self.cycle.each_foot, depth, strict=True)
            ]
        )

    def approach_height(self, dt_s: float) -> None:
        """Move the body towards the desired height."""
        limit = self._config.levelling.body_rate_m_s * dt_s
        self.height_m += min(max(self._settings.step.body_height_m - self.height_m, -limit), limit)

    def advance(self, command: np.ndarray, yaw: float, dt_s: float) -> None:
        """Advance the gait by one tick, according to the command.

        With a sway, the weight shifts before the first lift-off, and back after the last touch-down.

        Args:
            command: (3,) forward m/s, leftward m/s, yaw rad/s.
            yaw: yaw of the base, rad.
            dt_s: duration of the tick.
        """
        cycle, settings, shaped = self.cycle, self._settings, self.command
        desired = self._reduced_command(command)
        plan = self._sway_plan
        ready = self.active or self._sway.distance(plan.body) < _MAX_SWAY_ERROR_M
        shaped.advance(desired if ready else np.zeros(3), self._command_step_s(dt_s))
        walk = shaped.requests_walk(desired)
        if settings.changes_gait and not cycle.any_in_swing:
            self._change_gait()
        if cycle.timing.period_s != settings.gait.period_s:
            self._approach_period(dt_s)
        gait_changes = settings.changes_gait
        far = cycle.far_from_mid_stance(_MAX_REST_ERROR_M)
        lift_off = [not gait_changes and (walk or is_far) for is_far in far]
        if walk:
            self._pacing.set_tempo(shaped.value.tolist() == desired.tolist(), dt_s)
        walks = walk or cycle.any_in_swing or any(lift_off)
        gait_step_s = self._pacing.tempo * dt_s
        self._sway.approach(plan.body if walks else _NO_SWAY, gait_step_s / cycle.timing.period_s)
        self.active = ready and (walks or self._sway.distance(_NO_SWAY) > _MIN_SWAY_M)
        if self.active:
            length_m = settings.step.length_m
            velocity = self._travel.reduced(cycle, shaped.value.tolist(), length_m, dt_s)
            velocity[2] += self._heading.correction(yaw, velocity[2] * gait_step_s)
            cycle.advance(velocity, gait_step_s, settings.step.height_m, lift_off)
        else:
            self._heading.reset()
            cycle.clock = plan.start(cycle.clock)

    def _command_step_s(self, dt_s: float) -> float:
        """Time step for the command, s. With a sway it is smaller, so that a change takes some cycles.
        Otherwise the feet that swing last would travel so far before their first swing that they lose their
        load.
        """
        if not any(self._sway_plan.body.tolist()):
            return dt_s
        timing, limit = self.cycle.timing, self._config.command.acceleration_m_s2
        acceleration = self._settings.step.length_m / (timing.stance_s * _APPROACH_CYCLES * timing.period_s)
        return dt_s * min(1.0, acceleration / limit)

    def _reduced_command(self, command: np.ndarray) -> np.ndarray:
        """The command that the walk can follow; the first reduction in each gait adds a note."""
        stance_s, length_m = self.cycle.timing.stance_s, self._settings.step.length_m
        reduced = self._pacing.reduced_command(command, stance_s, length_m, self._steady)
        reason, gait = self._pacing.reason, self._settings.gait.name
        if reason and not any(note.startswith(f"{gait}: ") for note in self.notes):
            self.notes.append(f"{gait}: {reason}")
        return reduced

    def _steady(self, velocity: np.ndarray) -> SteadyWalk:
        """The current walk at a steady velocity (3,)."""
        timing, offsets, height_m = self.cycle.timing, self.cycle.offsets, self._settings.step.height_m
        return SteadyWalk(self.footing, timing, offsets, velocity, height_m, self._sway_plan, self.depth())

    def _change_gait(self) -> None:
        clock = self._settings.change_gait()
        self.cycle.change_gait(clock.timing, clock.offsets, self.command.value.tolist())
        self._sway_plan = self._plan_sway()
        self._pacing.invalidate()

    def _approach_period(self, dt_s: float) -> None:
        """Change the period gradually: the clock and the feet continue without a jump."""
        timing, requested_s = self.cycle.timing, self._settings.gait.period_s
        period_s = moved_towards(timing.period_s, requested_s, _PERIOD_RATE * dt_s)
        self.cycle.timing = GaitTiming(period_s, timing.duty)
        if period_s == requested_s:
            self._sway_plan = self._plan_sway()
            self._pacing.invalidate()

    def _plan_sway(self) -> SwayPlan:
        """Sway of the current gait."""
        cycle, height_m = self.cycle, self._settings.step.body_height_m + float(self._centre[2])
        positions, share = self.footing.positions[:, :2], self._config.stance.sway
        return plan_sway(positions, cycle.timing, cycle.offsets, height_m, share)


def footing_of(robot: Robot, config: WalkConfig) -> Footing:
    """Positions of a robot's feet in a walk. Raises UserError if a leg is too short."""
    legs, stance = robot.legs, config.stance
    height_m = config.step.body_height_m
    positions = nominal_feet(legs, height_m, stance.outward_m, stance.shift_m)
    lengths = {"stance.outward_m": stance.outward_m, "stance.shift_m": stance.shift_m}
    require_in_reach(robot, positions, {"step.body_height_m": height_m} | lengths)
    require_lift(robot, "step.height_m", config.step.height_m)
    return Footing(positions * [1.0, 1.0, 0.0], rolling_of(legs, positions, robot.default_pose))
