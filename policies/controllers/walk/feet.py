"""Where the feet are in the course of a gait, and when they lift off and touch down."""

import math
from collections.abc import Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from footfall.policies.controllers.gait import GaitTiming, leg_phases
from footfall.robots.kinematics import Legs

Number = TypeVar("Number", float, np.ndarray)

_QUARTER_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])  # (x, y) @ this = (-y, x)
_NUDGE_M = 0.005
_CLOCKS = np.arange(24) / 24
_UP = np.array([0.0, 0.0, 1.0])


def blend(s: Number) -> Number:
    """A quintic from 0 to 1 over s in [0, 1], at rest and without acceleration at both ends."""
    return s * s * s * (10.0 + s * (6.0 * s - 15.0))


def lift(s: float) -> float:
    """Height over a swing: from 0 up to 1 at s = 1/2 and back, at rest at both ends."""
    return 0.5 * (1.0 - math.cos(2.0 * math.pi * s))


class Footing(NamedTuple):
    """Where the tips of standing feet are, and how the body passes over them.

    A round foot rolls: its lowest point stands still, not its centre, so the body goes faster than the tip
    goes back. `rolling` turns the body's velocity over a foot into that of the tip.
    """

    places: np.ndarray  # (feet, 3) m, in the middle of each stance, z = 0 on the ground
    rolling: np.ndarray  # (feet, 2, 2)

    def passing(self, velocity: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Velocity (..., feet, 2) of the body over tips at (..., feet, 2), m/s.

        Args:
            velocity: (3,) forward m/s, leftward m/s, yaw rad/s of the body.
            points: (..., feet, 2) m.
        """
        over = velocity[:2] + velocity[2] * (points @ _QUARTER_TURN)
        return (self.rolling @ over[..., None])[..., 0]


def rolling_of(legs: Legs, tips: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """`Footing.rolling` (feet, 2, 2) of limbs whose tips (feet, 3), m, base frame, stand under a level base.

    Args:
        legs: whose inverse kinematics say how the links turn while the tips go with the ground.
        tips: in the middle of each stance.
        pose: (n,) rad, of joints outside the limbs.
    """
    step = _NUDGE_M * np.eye(3)[:2]
    rates = np.stack([legs.solve(tips + by) - legs.solve(tips - by) for by in step], axis=-1) / (2 * _NUDGE_M)
    axes = legs.pose(legs.scatter(legs.solve(tips), pose)).axes
    contact = np.eye(2) + (legs.rolling_offset(axes, _UP) @ rates)[:, :2]
    return np.linalg.inv(contact)


class Foot:
    """One foot. In Python's own numbers: on so few of them its arithmetic takes a fraction of NumPy's time.

    Args:
        place: (x, y) m, of the tip in the middle of its stance.
        rolling: of `Footing`, (2, 2).
    """

    def __init__(self, place: list[float], rolling: list[list[float]]) -> None:
        self.place_x, self.place_y, *_ = place
        (self._xx, self._xy), (self._yx, self._yy) = rolling
        self.reset()

    def reset(self) -> None:
        """On the ground, in its place."""
        self.x, self.y, self.z = self.place_x, self.place_y, 0.0
        self.swings, self.progress = False, 0.0
        self._left, self._height = (self.x, self.y, self.z), 0.0

    def lift_off(self, height_m: float) -> None:
        """Begin a swing."""
        self.swings, self._height = True, height_m
        self._left = self.x, self.y, self.z

    def carried(self, velocity: list[float]) -> float:
        """How far a body of a velocity has carried it out of its place, along its way over the ground, m."""
        over_x, over_y = self._passing(velocity, self.x, self.y)
        along = (self.place_x - self.x) * over_x + (self.place_y - self.y) * over_y
        return along / max(math.hypot(over_x, over_y), 1e-9)

    def land(self, ground_m: float) -> None:
        """End its swing on ground of a height, no lower than planned and no higher than the swing."""
        self.z = min(max(ground_m, 0.0), max(self._height, self.z))
        self.swings, self.progress = False, 0.0

    def stand(self, velocity: list[float], dt_s: float) -> None:
        """Go with the ground under a body of a velocity (m/s, m/s, rad/s)."""
        over_x, over_y = self._passing(velocity, self.x, self.y)
        self.x -= dt_s * over_x
        self.y -= dt_s * over_y

    def fly(self, velocity: list[float], dt_s: float, progress: float, timing: GaitTiming) -> None:
        """Be on the way from the point that was left to where the next stance begins, progress in [0, 1].

        The point that was left goes with the ground, and so does the other one: hence it is farther ahead by
        what is left of the swing.
        """
        self.progress = progress
        left_x, left_y, left_z = self._left
        over_x, over_y = self._passing(velocity, left_x, left_y)
        left_x, left_y = left_x - dt_s * over_x, left_y - dt_s * over_y
        self._left = left_x, left_y, left_z
        half_s, ahead_s = 0.5 * timing.stance_s, (1.0 - progress) * timing.swing_s
        over_x, over_y = self._passing(velocity, self.place_x, self.place_y)
        x, y = self.place_x + half_s * over_x, self.place_y + half_s * over_y
        over_x, over_y = self._passing(velocity, x, y)
        share = blend(progress)
        self.x = left_x + share * (x + ahead_s * over_x - left_x)
        self.y = left_y + share * (y + ahead_s * over_y - left_y)
        self.z = (1.0 - share) * left_z + self._height * lift(progress)

    def lower(self, by_m: float, least_m: float) -> None:
        """Lower a foot that stands, not below a height."""
        if not self.swings:
            self.z = min(self.z, max(self.z - by_m, least_m))

    def _passing(self, velocity: list[float], x: float, y: float) -> tuple[float, float]:
        """`Footing.passing` at one point."""
        forward, leftward, yaw = velocity
        over_x, over_y = forward - yaw * y, leftward + yaw * x
        return self._xx * over_x + self._xy * over_y, self._yx * over_x + self._yy * over_y


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
        self._feet = [
            Foot(*each) for each in zip(footing.places.tolist(), footing.rolling.tolist(), strict=True)
        ]
        self.begin(timing, offsets)
        self.reset()

    def reset(self) -> None:
        """All feet in their places on the ground, the clock at 0."""
        self.clock = 0.0
        for foot in self._feet:
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
        carried = np.array([foot.carried(velocity) for foot in self._feet])
        waits_s = (timing.duty - leg_phases(_CLOCKS[:, None], offsets)) % 1.0 * timing.period_s
        self.clock = float(_CLOCKS[np.argmin((carried + speed * waits_s).max(axis=1))])

    def carried(self, velocity: list[float]) -> float:
        """How far a body of a velocity has carried those feet that stand out of their places at most, m."""
        return max((foot.carried(velocity) for foot in self._feet if not foot.swings), default=0.0)

    @property
    def offsets(self) -> np.ndarray:
        """Place of each foot in the cycle, (feet,)."""
        return np.array(self._offsets)

    @property
    def feet(self) -> np.ndarray:
        """Where the feet are, (feet, 3) m."""
        return np.array([(foot.x, foot.y, foot.z) for foot in self._feet])

    @property
    def swings(self) -> np.ndarray:
        """Which feet swing, boolean (feet,)."""
        return np.array([foot.swings for foot in self._feet])

    @property
    def flies(self) -> bool:
        """Whether any foot swings."""
        return any(foot.swings for foot in self._feet)

    @property
    def progress(self) -> np.ndarray:
        """How far each swing has come, (feet,), in [0, 1]; 0 in stance."""
        return np.array([foot.progress for foot in self._feet])

    def phases(self) -> np.ndarray:
        """Place of each foot in its cycle, (feet,), in [0, 1)."""
        return np.array(self._phases())

    def astray(self, by_m: float) -> list[bool]:
        """Which feet are farther than this from the middle of their stance."""
        return [math.hypot(foot.x - foot.place_x, foot.y - foot.place_y) > by_m for foot in self._feet]

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
        for foot, before, now, may in zip(self._feet, phases, self._phases(), lift_off, strict=True):
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
        for foot, down, ground_m in zip(self._feet, feet.tolist(), ground.tolist(), strict=True):
            if down:
                foot.land(ground_m)

    def lower(self, feet: np.ndarray, by_m: float, least_m: float) -> None:
        """Lower standing feet (feet,) boolean, not below a height."""
        for foot, lowers in zip(self._feet, feet.tolist(), strict=True):
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
