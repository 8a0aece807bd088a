"""The steps of a mission, by their names in a file.

A step is a mapping with one key, its kind. The value is a mapping with the fields of its class, or only the
value of the first field: `turn: 90` and `turn: {by_deg: 90, timeout_s: 20}` differ only in the timeout.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from footfall.common.config import require_between, takes_other_keys
from footfall.common.limits import MAX_COMMAND, MAX_DURATION_S
from footfall.deploy.command_source import ZERO_COMMAND, Behaviour, Offer, Pose, Request
from footfall.operate.abilities import Limits
from footfall.operate.missions.activities import JUMP_S, Change, Cover, Hold, Leap, LieDown
from footfall.operate.missions.courses import MAX_DISTANCE_M, Circle, GoTo, Rectangle, Turn, Waypoints
from footfall.operate.missions.path import placed
from footfall.operate.missions.step import Plan, Scene, Step

MAX_JUMPS = 100
JUMP_M = 0.4  # approximate distance ahead


@dataclass(frozen=True)
class Wait:
    """Command zero for some time; a gait may step in place."""

    for_s: float

    def __post_init__(self) -> None:
        require_between(self, 0.0, MAX_DURATION_S, "for_s")

    def check(self, limits: Limits, offer: Offer) -> None:
        """Possible with any policy."""

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        return Plan(self.for_s, begin, Hold(Request(ZERO_COMMAND), self.for_s))


@dataclass(frozen=True)
class Stand(Wait):
    """Stand for some time."""

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        return Plan(self.for_s, begin, Hold(Request(ZERO_COMMAND, Behaviour.STAND), self.for_s))


@dataclass(frozen=True)
class Walk:
    """Walk with a velocity for some time or over a distance."""

    velocity: tuple[float, float, float]  # forward m/s, leftward m/s, yaw rad/s
    for_s: float | None = None
    distance_m: float | None = None  # straight distance from its start

    def __post_init__(self) -> None:
        if (self.for_s is None) == (self.distance_m is None):
            raise ValueError("give for_s or distance_m")
        require_between(self, -MAX_COMMAND, MAX_COMMAND, "velocity")
        require_between(self, 0.0, MAX_DURATION_S, "for_s")
        require_between(self, 0.0, MAX_DISTANCE_M, "distance_m")
        if self.distance_m is not None and (self.velocity[2] or not any(self.velocity)):
            raise ValueError("distance_m requires a velocity that moves the robot and does not turn it")

    def check(self, limits: Limits, offer: Offer) -> None:
        for name, value, (low, high) in zip(
            ("forward", "leftward", "yaw"), self.velocity, vars(limits.ranges).values(), strict=True
        ):
            if not low <= value <= high:
                raise ValueError(
                    f"velocity: the {name} command goes from {low:g} to {high:g}, not to {value:g}"
                )

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        velocity = np.array(self.velocity)
        if self.for_s is not None:
            return Plan(
                self.for_s, _after(begin, self.velocity, self.for_s), Hold(Request(velocity), self.for_s)
            )
        assert self.distance_m is not None
        duration_s = self.distance_m / math.hypot(*self.velocity[:2])
        return Plan(
            duration_s, _after(begin, self.velocity, duration_s), Cover(velocity, self.distance_m, begin)
        )


@dataclass(frozen=True)
class UseGait:
    """Change to another gait of the policy."""

    name: str

    def check(self, limits: Limits, offer: Offer) -> None:
        if self.name not in offer.gaits:
            raise ValueError(f"no gait '{self.name}': {', '.join(offer.gaits) or 'the policy has one only'}")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        return Plan(0.0, begin, Change(gait=self.name))


@dataclass(frozen=True)
class UsePolicy:
    """Change to another policy."""

    name: str

    def check(self, limits: Limits, offer: Offer) -> None:
        if self.name not in offer.policies:
            raise ValueError(f"no policy '{self.name}' in this run: {', '.join(offer.policies)}")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        return Plan(0.0, begin, Change(policy=self.name))


@dataclass(frozen=True)
class Jump:
    """Jump ahead with the policy `jump`, then return to the previous policy."""

    times: int = 1

    name = "jump"  # name of the policy

    def __post_init__(self) -> None:
        require_between(self, 1, MAX_JUMPS, "times")

    def check(self, limits: Limits, offer: Offer) -> None:
        if self.name not in offer.policies:
            raise ValueError(f"no policy '{self.name}' in this run: {', '.join(offer.policies)}")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        end = _after(begin, (JUMP_M, 0.0, 0.0), self.times)
        return Plan(self.times * JUMP_S, end, Leap(self.name, self.times))


@takes_other_keys("settings")
@dataclass(frozen=True)
class Set:
    """Change live settings of the policy, by name."""

    settings: dict[str, float] = field(default_factory=dict)

    def check(self, limits: Limits, offer: Offer) -> None:
        for name, value in self.settings.items():
            if (span := offer.settings.get(name)) is None:
                known = ", ".join(offer.settings) or "the policy has none"
                raise ValueError(f"no live setting '{name}': {known}")
            if not span.lowest <= value <= span.highest:
                raise ValueError(f"{name} goes from {span.lowest:g} to {span.highest:g}, not to {value:g}")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        return Plan(0.0, begin, Change(settings=self.settings))


@dataclass(frozen=True)
class End:
    """The robot lies down, which ends the run. A mission always ends this way."""

    def check(self, limits: Limits, offer: Offer) -> None:
        """Possible with any policy."""

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        return Plan(0.0, begin, LieDown())


STEPS: dict[str, type[Step]] = {
    "stand": Stand,
    "wait": Wait,
    "walk": Walk,
    "turn": Turn,
    "go_to": GoTo,
    "waypoints": Waypoints,
    "rectangle": Rectangle,
    "circle": Circle,
    "gait": UseGait,
    "policy": UsePolicy,
    "jump": Jump,
    "set": Set,
    "lie_down": End,
}


def _after(begin: Pose, velocity: tuple[float, float, float], time_s: float) -> Pose:
    """Pose after a constant body velocity."""
    forward, leftward, rate = velocity
    angle = rate * time_s
    # Mean direction during the turn: integrals of cosine and sine, by a series near zero.
    sin, cos = (math.sin(angle) / angle, (1 - math.cos(angle)) / angle) if abs(angle) > 1e-6 else (1.0, 0.0)
    ahead, left = time_s * (forward * sin - leftward * cos), time_s * (forward * cos + leftward * sin)
    x, y = placed(np.array([[ahead, left]]), begin)[0].tolist()
    return Pose(x, y, begin.yaw_rad + angle)
