"""Where the feet are in the course of a gait, and when they lift off and touch down."""

import math
from collections.abc import Sequence

import numpy as np

from footfall.policies.controllers.gait import GaitTiming, leg_phases, trust_at
from footfall.policies.controllers.walk.foot import Foot, Footing, blend, lift

_CLOCKS = np.arange(24) / 24


class FootCycle:
    """Feet that stand go with the ground, feet that swing fly over it to where their next stance begins.

    Places are those of the tips in the level body's frame, z = 0 on the ground. A swing leads from the point
    that was left to the one that is aimed at, and both go with the ground: so place and velocity are
    continuous at lift-off and at touch-down, also while the velocity changes.

    Args:
        footing: where feet stand.
        timing: of the gait.
        offsets: (feet,) place of each foot in the cycle.
    """

    def __init__(self, footing: Footing, timing: GaitTiming, offsets: np.ndarray) -> None:
        self.each_foot = [
            Foot(*each) for each in zip(footing.places.tolist(), footing.rolling.tolist(), strict=True)
        ]
        self.begin(timing, offsets)
        self.reset()

    def reset(self) -> None:
        """All feet in their places on the ground, the clock at 0."""
        self.clock = 0.0
        for foot in self.each_foot:
            foot.reset()

    def begin(self, timing: GaitTiming, offsets: np.ndarray) -> None:
        """Another gait, for feet that all stand. One that would be in the air waits for its next swing."""
        self.timing, self._offsets = timing, offsets.tolist()

    def begin_anew(self, timing: GaitTiming, offsets: np.ndarray, velocity: list[float]) -> None:
        """Another gait while the body goes on, for feet that all stand.

        The clock is set to where the feet that have been carried farthest lift off first, so that none is
        carried farther than need be until it does.
        """
        self.begin(timing, offsets)
        speed = math.hypot(*velocity[:2])
        carried = np.array([foot.carried(velocity) for foot in self.each_foot])
        waits_s = (timing.duty - leg_phases(_CLOCKS[:, None], offsets)) % 1.0 * timing.period_s
        self.clock = float(_CLOCKS[np.argmin((carried + speed * waits_s).max(axis=1))])

    def carried(self, velocity: list[float]) -> float:
        """How far a body of a velocity has carried those feet that stand out of their places at most, m."""
        return max((foot.carried(velocity) for foot in self.each_foot if not foot.swings), default=0.0)

    @property
    def offsets(self) -> np.ndarray:
        """Place of each foot in the cycle, (feet,)."""
        return np.array(self._offsets)

    @property
    def feet(self) -> np.ndarray:
        """Where the feet are, (feet, 3) m."""
        return np.array([(foot.x, foot.y, foot.z) for foot in self.each_foot])

    @property
    def swings(self) -> np.ndarray:
        """Which feet swing, boolean (feet,)."""
        return np.array([foot.swings for foot in self.each_foot])

    @property
    def flies(self) -> bool:
        """Whether any foot swings."""
        return any(foot.swings for foot in self.each_foot)

    @property
    def progress(self) -> np.ndarray:
        """How far each swing has come, (feet,), in [0, 1]; 0 in stance."""
        return np.array([foot.progress for foot in self.each_foot])

    def footholds(self, body: tuple[float, float], height_m: float) -> np.ndarray:
        """Where feet that swing land, (feet, 3) m, from a base above `body`, m; NaN for the others."""
        x, y = body
        return np.array(
            [
                (foot.lands[0] - x, foot.lands[1] - y, -height_m) if foot.swings else (math.nan,) * 3
                for foot in self.each_foot
            ]
        )

    def phases(self) -> np.ndarray:
        """Place of each foot in its cycle, (feet,), in [0, 1)."""
        return np.array(self._phases())

    def stance(self) -> np.ndarray:
        """Trust in each foot's contact, (feet,): 0 while it swings, 1 while it waits to swing."""
        duty = self.timing.duty
        return np.array(
            [
                0.0 if foot.swings else 1.0 if phase >= duty else trust_at(phase, duty, edge=0.1)
                for foot, phase in zip(self.each_foot, self._phases(), strict=True)
            ]
        )

    def astray(self, by_m: float) -> list[bool]:
        """Which feet are farther than this from the middle of their stance."""
        return [math.hypot(foot.x - foot.place_x, foot.y - foot.place_y) > by_m for foot in self.each_foot]

    def advance(
        self, velocity: list[float], dt_s: float, step_height_m: float, lift_off: Sequence[bool]
    ) -> None:
        """Let time pass.

        Args:
            velocity: forward m/s, leftward m/s, yaw rad/s of the body.
            dt_s: how long.
            step_height_m: of swings that begin now.
            lift_off: of each foot, whether it may lift off; those in the air land in any case.
        """
        timing, duty = self.timing, self.timing.duty
        phases = self._phases()
        self.clock = (self.clock + dt_s / timing.period_s) % 1.0
        for foot, before, now, may in zip(self.each_foot, phases, self._phases(), lift_off, strict=True):
            if foot.swings and now < duty:
                foot.land(0.0)
            elif before < duty <= now and may and not foot.swings:
                foot.lift_off(step_height_m)
            if foot.swings:
                foot.fly(velocity, dt_s, (now - duty) / (1.0 - duty), timing)
            else:
                foot.stand(velocity, dt_s)

    def touch_down(self, feet: np.ndarray, height: np.ndarray) -> None:
        """Feet that have met the ground before their time stand on it.

        How high it is there those that stand tell. Where the body tips, a foot in the air meets ground that
        is no higher: it goes on to the height of the others, and so rights the body.

        Args:
            feet: (feet,) boolean, those that have.
            height: (feet,) m, of all tips along the vertical, from wherever.
        """
        if not np.count_nonzero(feet):
            return
        stands = ~self.swings
        above = height - self.feet[:, 2]
        ground = height - above[stands if stands.any() else feet].mean()
        for foot, down, ground_m in zip(self.each_foot, feet.tolist(), ground.tolist(), strict=True):
            if down:
                foot.land(ground_m)

    def lower(self, feet: Sequence[bool], by_m: float, least_m: float) -> None:
        """Lower those feet that stand, not below a height."""
        for foot, lowers in zip(self.each_foot, feet, strict=True):
            if lowers:
                foot.lower(by_m, least_m)

    def _phases(self) -> list[float]:
        clock = self.clock
        return [(clock + offset) % 1.0 for offset in self._offsets]


def steady_cycle(
    footing: Footing, timing: GaitTiming, velocity: np.ndarray, step_height_m: float, progress: np.ndarray
) -> np.ndarray:
    """Feet (k, feet, 3) of a steady walk at k points of each foot's own swing, progress in [0, 1]."""
    passing = footing.passing(velocity, footing.places[:, :2])
    share, along = blend(progress)[:, None, None], progress[:, None, None]
    whole = timing.stance_s + timing.swing_s
    feet = np.tile(footing.places, (len(progress), 1, 1))
    feet[:, :, :2] += passing * (share * whole - along * timing.swing_s - 0.5 * timing.stance_s)
    feet[:, :, 2] = step_height_m * np.array([[lift(s)] for s in progress.tolist()])
    return feet


def stances(
    footing: Footing, timing: GaitTiming, offsets: np.ndarray, velocity: np.ndarray, clocks: np.ndarray
) -> list[list[tuple[float, float]]]:
    """Points on which a steady walk stands at each of k times of the gait's clock."""
    places = footing.places[:, :2]
    passing = footing.passing(velocity, places)
    found = []
    for clock in clocks.tolist():
        phases = leg_phases(clock, offsets)
        stands = phases < timing.duty
        feet = places + (0.5 - phases / timing.duty)[:, None] * timing.stance_s * passing
        found.append([(x, y) for x, y in feet[stands].tolist()])
    return found
