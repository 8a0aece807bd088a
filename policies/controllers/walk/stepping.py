"""Steps: which feet swing, how far the body is carried and how it sways, as commands want it."""

import numpy as np

from footfall.policies.controllers.command import ShapedCommand
from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.stance import nominal_feet
from footfall.policies.controllers.walk.config import StrideConfig, WalkConfig
from footfall.policies.controllers.walk.feet import FootCycle
from footfall.policies.controllers.walk.foot import Footing, rolling_of
from footfall.policies.controllers.walk.heading import Heading
from footfall.policies.controllers.walk.limits import SteadyWalk, WalkLimits
from footfall.policies.controllers.walk.live import WalkSettings
from footfall.policies.controllers.walk.pacing import Pacing
from footfall.policies.controllers.walk.room import Room
from footfall.policies.controllers.walk.sway import Sway, SwayPlan, plan_sway
from footfall.policies.live_settings import approached
from footfall.robots.description import Robot

_PERIOD_RATE = 0.1  # s of the gait's period in each second
_NO_SWAY = np.zeros(2, complex)
_APPROACH = 2.0  # cycles in which a gait with a sway comes to its longest steps at best
_SHIFTED_M = 0.002  # a body that is as near as this to its sway is ready for the first step
_STILL_M = 1e-4  # a sway below this is none
_ASTRAY_M = 0.01  # a robot that has come to rest brings feet farther away than this to their places


class Stepping:
    """The feet of a walk below its body. `notes` says once for each gait how limits changed the command."""

    def __init__(self, robot: Robot, config: WalkConfig, settings: WalkSettings, centre: np.ndarray) -> None:
        """`centre` is the centre of mass (3,), m, from the base's origin."""
        self._config, self._settings, self._centre = config, settings, centre
        self._radius = robot.legs.foot_radius
        self.footing = footing_of(robot, config)
        farthest_m = float(np.hypot(*self.footing.places[:, :2].T).max())
        self._pacing = Pacing(WalkLimits(robot, centre[:2], config.limits), farthest_m)
        clock = config.gait.clock(robot)
        self._own = clock.timing, clock.offsets
        self.cycle = FootCycle(self.footing, *self._own)
        self._sway, self.command = Sway(), ShapedCommand(config.command)
        self._heading, self._room = Heading(config.heading), Room()
        self.notes: list[str] = []
        self.reset()

    def reset(self) -> None:
        """All feet in their places on the ground, with the configuration's own gait."""
        self._settings.reset()
        self.cycle.begin(*self._own)
        for part in (self.cycle, self.command, self._sway, self._pacing, self._heading, self._room):
            part.reset()
        self.height_m = self._settings.step.body_height_m
        self._sway_plan = self._plan_sway()
        self.active = False  # whether feet step, or are about to

    def change_step(self, step: StrideConfig) -> None:
        """Ask for other steps."""
        if step != self._settings.step:
            self._settings.step = step
            self._pacing.look_again()

    def stance(self) -> np.ndarray:
        """Trust in each foot's contact, (feet,)."""
        return self.cycle.stance() if self.active else np.ones(len(self.footing.places))

    def footholds(self) -> np.ndarray:
        """Where feet that swing land, (feet, 3) m, from the base; NaN for the others."""
        return self.cycle.footholds(self._sway.at(self.cycle.clock), self.height_m)

    def below(self) -> np.ndarray:
        """From the base's origin down to each tip that stands, (feet,) m."""
        return self.height_m - self._radius

    def tips(self, shift: complex) -> np.ndarray:
        """Where the tips should be, (feet, 3) m, from a level base; `shift` moves all of them, m, x + i y."""
        (sway_x, sway_y), below = self._sway.at(self.cycle.clock), self.below().tolist()
        return np.array(
            [
                (foot.x - sway_x + shift.real, foot.y - sway_y + shift.imag, foot.z - below_m)
                for foot, below_m in zip(self.cycle.each_foot, below, strict=True)
            ]
        )

    def approach_height(self, dt_s: float) -> None:
        """Raise or lower the body towards the height that was asked for."""
        most = self._config.levelling.body_rate_m_s * dt_s
        self.height_m += min(max(self._settings.step.body_height_m - self.height_m, -most), most)

    def advance(self, command: np.ndarray, yaw: float, dt_s: float) -> None:
        """Let feet stand, swing, lift off and land as the command wants it.

        With a sway the weight is shifted before the first foot lifts off, and back after the last has landed.

        Args:
            command: (3,) forward m/s, leftward m/s, yaw rad/s.
            yaw: of the base, rad.
            dt_s: of the tick.
        """
        cycle, settings, shaped = self.cycle, self._settings, self.command
        wanted = self._within_limits(command)
        plan = self._sway_plan
        ready = self.active or self._sway.misses(plan.body) < _SHIFTED_M
        shaped.advance(wanted if ready else np.zeros(3), self._calm(dt_s))
        walk = shaped.wants_walk(wanted)
        if settings.changes_gait and not cycle.flies:
            self._take_up_gait()
        if cycle.timing.period_s != settings.gait.period_s:
            self._approach_period(dt_s)
        changes = settings.changes_gait
        lift_off = [not changes and (walk or away) for away in cycle.astray(_ASTRAY_M)]
        if walk:
            self._pacing.set_tempo(shaped.value.tolist() == wanted.tolist(), dt_s)
        wants = walk or cycle.flies or any(lift_off)
        passed_s = self._pacing.tempo * dt_s
        self._sway.approach(plan.body if wants else _NO_SWAY, passed_s / cycle.timing.period_s)
        self.active = ready and (wants or self._sway.misses(_NO_SWAY) > _STILL_M)
        if self.active:
            length_m = settings.step.length_m
            velocity = self._room.left_to(cycle, shaped.value.tolist(), length_m, dt_s)
            velocity[2] += self._heading.correction(yaw, velocity[2] * passed_s)
            cycle.advance(velocity, passed_s, settings.step.height_m, lift_off)
        else:
            self._heading.reset()
            cycle.clock = plan.start(cycle.clock)

    def _calm(self, dt_s: float) -> float:
        """How long a command is approached for in a tick: with a sway, no faster than in some cycles.

        Feet whose first swing comes last would be carried so far out meanwhile that the weight left them.
        """
        if not any(self._sway_plan.body.tolist()):
            return dt_s
        timing, most = self.cycle.timing, self._config.command.acceleration_m_s2
        calm = self._settings.step.length_m / (timing.stance_s * _APPROACH * timing.period_s)
        return dt_s * min(1.0, calm / most)

    def _within_limits(self, command: np.ndarray) -> np.ndarray:
        """The command that the walk can follow; once for each gait a note says what is left out."""
        stance_s, length_m = self.cycle.timing.stance_s, self._settings.step.length_m
        within = self._pacing.within(command, stance_s, length_m, self._steady)
        reason, gait = self._pacing.reason, self._settings.gait.name
        if reason and not any(note.startswith(f"{gait}: ") for note in self.notes):
            self.notes.append(f"{gait}: {reason}")
        return within

    def _steady(self, velocity: np.ndarray) -> SteadyWalk:
        """The present walk at a steady velocity (3,)."""
        timing, offsets, height_m = self.cycle.timing, self.cycle.offsets, self._settings.step.height_m
        return SteadyWalk(self.footing, timing, offsets, velocity, height_m, self._sway_plan, self.below())

    def _take_up_gait(self) -> None:
        clock = self._settings.take_up_gait()
        self.cycle.begin_anew(clock.timing, clock.offsets, self.command.value.tolist())
        self._sway_plan = self._plan_sway()
        self._pacing.look_again()

    def _approach_period(self, dt_s: float) -> None:
        """Change the period slowly: the clock goes on, and so does each foot on its way."""
        timing, wanted_s = self.cycle.timing, self._settings.gait.period_s
        period_s = approached(timing.period_s, wanted_s, _PERIOD_RATE * dt_s)
        self.cycle.timing = GaitTiming(period_s, timing.duty)
        if period_s == wanted_s:
            self._sway_plan = self._plan_sway()
            self._pacing.look_again()

    def _plan_sway(self) -> SwayPlan:
        """The sway of the present gait."""
        cycle, height_m = self.cycle, self._settings.step.body_height_m + float(self._centre[2])
        places, share = self.footing.places[:, :2], self._config.stance.sway
        return plan_sway(places, cycle.timing, cycle.offsets, height_m, share)


def footing_of(robot: Robot, config: WalkConfig) -> Footing:
    """Where the feet of a robot stand in a walk."""
    legs, stance = robot.legs, config.stance
    places = nominal_feet(legs, config.step.body_height_m, stance.outward_m, stance.shift_m)
    return Footing(places * [1.0, 1.0, 0.0], rolling_of(legs, places, robot.default_pose))
