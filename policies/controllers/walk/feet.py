"""Positions of the feet during a gait, with lift-off and touch-down."""

import math
from collections.abc import Sequence

import numpy as np

from footfall.policies.controllers.gait import GaitTiming, leg_phases, trust_at
from footfall.policies.controllers.walk.foot import Foot, Footing, blend, lift

_START_PHASES = np.arange(24) / 24  # phases from which `change_gait` chooses


class FootCycle:
    """Stance feet move with the ground. Swing feet fly over it to the start of their next stance.

    Positions are those of the tips in the level body's frame, z = 0 on the ground. A swing leads from the
    lift-off point to the target. Both points move with the ground, so position and velocity are continuous at
    lift-off and at touch-down, even while the velocity changes.

    Args:
        footing: positions of stance feet.
        timing: timing of the gait.
        offsets: (feet,) phase offset of each foot.
    """

    def __init__(self, footing: Footing, timing: GaitTiming, offsets: np.ndarray) -> None:
        self.each_foot = [
            Foot(*each) for each in zip(footing.positions.tolist(), footing.rolling.tolist(), strict=True)
        ]
        self.begin(timing, offsets)
        self.reset()

    def reset(self) -> None:
        """Place all feet at mid-stance, with the clock at 0."""
        self.clock = 0.0
        for foot in self.each_foot:
            foot.reset()

    def begin(self, timing: GaitTiming, offsets: np.ndarray) -> None:
        """Change the gait while all feet are in stance. A foot that would be in swing waits for its next
        swing."""
        self.timing, self._offsets = timing, offsets.tolist()

    def change_gait(self, timing: GaitTiming, offsets: np.ndarray, velocity: list[float]) -> None:
        """Change the gait while the body moves and all feet are in stance.

        The clock is set so that the feet with the largest travel lift off first. This minimises the largest
        travel.
        """
        self.begin(timing, offsets)
        speed = math.hypot(*velocity[:2])
        travel = np.array([foot.travel(velocity) for foot in self.each_foot])
        waits_s = (timing.duty - leg_phases(_START_PHASES[:, None], offsets)) % 1.0 * timing.period_s
        self.clock = float(_START_PHASES[np.argmin((travel + speed * waits_s).max(axis=1))])

    def travel(self, velocity: list[float]) -> float:
        """Largest displacement of a stance foot from mid-stance, along the body's motion, m."""
        return max((foot.travel(velocity) for foot in self.each_foot if not foot.swings), default=0.0)

    @property
    def offsets(self) -> np.ndarray:
        """Phase offset of each foot, (feet,)."""
        return np.array(self._offsets)

    @property
    def feet(self) -> np.ndarray:
        """Positions of the feet, (feet, 3) m."""
        return np.array([(foot.x, foot.y, foot.z) for foot in self.each_foot])

    @property
    def swings(self) -> np.ndarray:
        """Feet in swing, boolean (feet,)."""
        return np.array([foot.swings for foot in self.each_foot])

    @property
    def any_in_swing(self) -> bool:
        """Whether any foot is in swing."""
        return any(foot.swings for foot in self.each_foot)

    @property
    def progress(self) -> np.ndarray:
        """Progress of each swing, (feet,), in [0, 1]; 0 in stance."""
        return np.array([foot.progress for foot in self.each_foot])

    def footholds(self, body: tuple[float, float], height_m: float) -> np.ndarray:
        """Footholds of swing feet, (feet, 3) m, relative to a base above `body`, m; NaN for stance feet."""
        x, y = body
        return np.array(
            [
                (foot.foothold[0] - x, foot.foothold[1] - y, -height_m) if foot.swings else (math.nan,) * 3
                for foot in self.each_foot
            ]
        )

    def phases(self) -> np.ndarray:
        """Phase of each foot in its cycle, (feet,), in [0, 1)."""
        return np.array(self._phases())

    def stance(self) -> np.ndarray:
        """Trust in each foot's contact, (feet,): 0 in swing, 1 while the foot waits to swing."""
        duty = self.timing.duty
        return np.array(
            [
                0.0 if foot.swings else 1.0 if phase >= duty else trust_at(phase, duty, edge=0.1)
                for foot, phase in zip(self.each_foot, self._phases(), strict=True)
            ]
        )

    def far_from_mid_stance(self, by_m: float) -> list[bool]:
        """Feet farther than this from mid-stance."""
        return [math.hypot(foot.x - foot.mid_x, foot.y - foot.mid_y) > by_m for foot in self.each_foot]

    def advance(
        self, velocity: list[float], dt_s: float, step_height_m: float, lift_off: Sequence[bool]
    ) -> None:
        """Advance by `dt_s`.

        Args:
            velocity: forward m/s, leftward m/s, yaw rad/s of the body.
            dt_s: time step.
            step_height_m: height of swings that start now.
            lift_off: whether each foot may lift off; feet in the air land in any case.
        """
        timing, duty = self.timing, self.timing.duty
        phases = self._phases()
        self.clock = (self.clock + dt_s / timing.period_s) % 1.0
        for foot, before, now, allowed in zip(self.each_foot, phases, self._phases(), lift_off, strict=True):
            if foot.swings and now < duty:
                foot.land(0.0)
            elif before < duty <= now and allowed and not foot.swings:
                foot.lift_off(step_height_m)
            if foot.swings:
                foot.fly(velocity, dt_s, (now - duty) / (1.0 - duty), timing)
            else:
                foot.stand(velocity, dt_s)

    def touch_down(self, feet: np.ndarray, height: np.ndarray) -> None:
        """End the swing of feet that have touched down early.

        The height of the ground is measured relative to the stance feet. If the body tips, a swing foot meets
        ground that is not higher: the foot then moves to the height of the stance feet. This levels the body.

        Args:
            feet: (feet,) boolean, feet that have touched down.
            height: (feet,) m, heights of all tips above any common reference.
        """
        if not np.count_nonzero(feet):
            return
        stands = ~self.swings
        above = height - self.feet[:, 2]
        ground = height - above[stands if stands.any() else feet].mean()
        for foot, touched, ground_m in zip(self.each_foot, feet.tolist(), ground.tolist(), strict=True):
            if touched:
                foot.land(ground_m)

    def lower(self, feet: Sequence[bool], by_m: float, min_z_m: float) -> None:
        """Lower stance feet, to a minimum height."""
        for foot, lowers in zip(self.each_foot, feet, strict=True):
            if lowers:
                foot.lower(by_m, min_z_m)

    def _phases(self) -> list[float]:
        clock = self.clock
        return [(clock + offset) % 1.0 for offset in self._offsets]


def steady_cycle(
    footing: Footing, timing: GaitTiming, velocity: np.ndarray, step_height_m: float, progress: np.ndarray
) -> np.ndarray:
    """Feet (k, feet, 3) of a steady walk at k progress values in [0, 1] of each foot's own swing."""
    passing_velocity = footing.passing_velocity(velocity, footing.positions[:, :2])
    share, along = blend(progress)[:, None, None], progress[:, None, None]
    period_s = timing.stance_s + timing.swing_s
    feet = np.tile(footing.positions, (len(progress), 1, 1))
    feet[:, :, :2] += passing_velocity * (share * period_s - along * timing.swing_s - 0.5 * timing.stance_s)
    feet[:, :, 2] = step_height_m * np.array([[lift(s)] for s in progress.tolist()])
    return feet


def stances(
    footing: Footing, timing: GaitTiming, offsets: np.ndarray, velocity: np.ndarray, clocks: np.ndarray
) -> list[list[tuple[float, float]]]:
    """Positions of the stance feet of a steady walk at each of k phases of the gait's clock."""
    positions = footing.positions[:, :2]
    passing_velocity = footing.passing_velocity(velocity, positions)
    found = []
    for clock in clocks.tolist():
        phases = leg_phases(clock, offsets)
        stands = phases < timing.duty
        feet = positions + (0.5 - phases / timing.duty)[:, None] * timing.stance_s * passing_velocity
        found.append([(x, y) for x, y in feet[stands].tolist()])
    return found
