"""Steps of a mission that use odometry: turns, points, paths."""

import math
import re
from dataclasses import KW_ONLY, dataclass

import numpy as np

from footfall.common.config import require_between
from footfall.common.limits import MAX_COMMAND, MAX_DURATION_S
from footfall.deploy.command_source import Offer, Pose
from footfall.operate.abilities import Limits
from footfall.operate.missions.activities import Follow, Reach
from footfall.operate.missions.follow import distance
from footfall.operate.missions.path import SPACING_M, circle, placed, rectangle, sample
from footfall.operate.missions.step import Plan, Scene

MAX_DISTANCE_M = 1000.0  # of a point
MAX_PATH_M = 500.0  # of a path: it is planned between two steps of the policy
MIN_SIZE_M = 0.1  # side of a rectangle, radius of a circle
_SIZE = re.compile(r"(\d+\.?\d*)x(-?\d+\.?\d*)")


@dataclass(frozen=True)
class OdometryStep:
    """A step that uses odometry."""

    _: KW_ONLY
    speed_m_s: float | None = None
    timeout_s: float | None = None  # default: three times its planned time plus ten seconds

    def __post_init__(self) -> None:
        require_between(self, 0.01, MAX_COMMAND, "speed_m_s")
        require_between(self, 0.1, MAX_DURATION_S, "timeout_s")

    def check(self, limits: Limits, offer: Offer) -> None:
        if not limits.omnidirectional:
            raise ValueError("the policy must accept forward, sideways and yaw commands in both directions")
        fastest = limits.ranges.forward_m_s[1]
        if self.speed_m_s is not None and self.speed_m_s > fastest:
            raise ValueError(f"speed_m_s goes up to {fastest:g}, not to {self.speed_m_s:g}")

    def _follow(self, corners: np.ndarray, begin: Pose, end_yaw: float | None, scene: Scene) -> Plan:
        length_m = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
        if length_m > MAX_PATH_M:
            raise ValueError(
                f"the path is {length_m:.0f} m long: {MAX_PATH_M:g} m at most, use several steps"
            )
        path = sample(corners, begin.yaw_rad, end_yaw, scene.pace(self.speed_m_s))
        first_s = abs(float(path.heading[0]) - begin.yaw_rad) / scene.limits.yaw_rad_s
        duration_s = first_s + float(path.remaining_s[0])
        return Plan(duration_s, path.end, Follow(path, scene.limits, scene.tracking))


@dataclass(frozen=True)
class Turn(OdometryStep):
    """Turn on the spot, left if positive."""

    by_deg: float

    def __post_init__(self) -> None:
        super().__post_init__()
        require_between(self, -3600.0, 3600.0, "by_deg")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        angle = math.radians(self.by_deg)
        goal = begin._replace(yaw_rad=begin.yaw_rad + angle)
        activity = Reach(goal, scene.limits, scene.tracking)
        return Plan(abs(angle) / scene.limits.yaw_rad_s, goal, activity)


@dataclass(frozen=True)
class GoTo(OdometryStep):
    """Walk straight to a point in the mission's frame: origin at its start, x forward, y left."""

    to: tuple[float, float]  # m
    heading_deg: float | None = None  # at the end; default: the direction of the walk

    def __post_init__(self) -> None:
        super().__post_init__()
        require_between(self, -MAX_DISTANCE_M, MAX_DISTANCE_M, "to")
        require_between(self, -3600.0, 3600.0, "heading_deg")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        end_yaw = None if self.heading_deg is None else math.radians(self.heading_deg)
        if distance(begin, Pose(*self.to, 0.0)) < SPACING_M:
            yaw = begin.yaw_rad
            turn = 0.0 if end_yaw is None else math.remainder(end_yaw - yaw, 2 * math.pi)
            goal = Pose(*self.to, yaw + turn)
            return Plan(0.0, goal, Reach(goal, scene.limits, scene.tracking))
        return self._follow(np.array([begin[:2], self.to]), begin, end_yaw, scene)


@dataclass(frozen=True)
class Waypoints(OdometryStep):
    """Walk in straight lines from point to point in the mission's frame: origin at its start, x forward, y
    left."""

    points: tuple[tuple[float, float], ...]  # m
    heading_deg: float | None = None  # at the end; default: the direction of the last line

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.points:
            raise ValueError("points: none is given")
        for point in self.points:
            if not all(abs(value) <= MAX_DISTANCE_M for value in point):
                raise ValueError(f"points: {list(point)} is farther than {MAX_DISTANCE_M:g} m")
        if any(
            math.dist(one, next_) < SPACING_M
            for one, next_ in zip(self.points, self.points[1:], strict=False)
        ):
            raise ValueError("points: two in a row are the same")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        end_yaw = None if self.heading_deg is None else math.radians(self.heading_deg)
        first = [] if math.dist(begin[:2], self.points[0]) < SPACING_M else [begin[:2]]
        corners = np.array([*first, *self.points])
        if len(corners) == 1:
            return GoTo(self.points[0], self.heading_deg).plan(begin, scene)
        return self._follow(corners, begin, end_yaw, scene)


@dataclass(frozen=True)
class Rectangle(OdometryStep):
    """Walk along a rectangle that starts here: ahead, then left, or right for a negative width."""

    size: str  # length x width, m: 2x1

    def __post_init__(self) -> None:
        super().__post_init__()
        if (found := _SIZE.fullmatch(self.size.replace(" ", ""))) is None:
            raise ValueError(f"size is length x width in metres, such as 2x1, not '{self.size}'")
        if not all(MIN_SIZE_M <= abs(float(side)) <= MAX_DISTANCE_M for side in found.groups()):
            raise ValueError(f"size: sides are {MIN_SIZE_M:g} to {MAX_DISTANCE_M:g} m, not {self.size}")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        length, width = map(float, self.size.replace(" ", "").split("x"))
        return self._follow(placed(rectangle(length, width), begin), begin, begin.yaw_rad, scene)


@dataclass(frozen=True)
class Circle(OdometryStep):
    """Walk along a circle that starts here and bends left, or right for a negative radius."""

    radius_m: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not MIN_SIZE_M <= abs(self.radius_m) <= MAX_DISTANCE_M:
            raise ValueError(f"radius_m is {MIN_SIZE_M:g} to {MAX_DISTANCE_M:g} m, not {self.radius_m:g}")

    def plan(self, begin: Pose, scene: Scene) -> Plan:
        return self._follow(placed(circle(self.radius_m), begin), begin, begin.yaw_rad, scene)
