"""Activities of a mission's steps: each computes a command from the pose at each policy step."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from footfall.deploy.command_source import NO_SETTINGS, ZERO_COMMAND, Behaviour, Pose, Request
from footfall.operate.abilities import Limits
from footfall.operate.missions.follow import Tracking, along, arrived, distance, nearest, towards
from footfall.operate.missions.path import Path

TAKES_OVER_S = 10.0  # maximum time for a policy to take over, or to start a jump
JUMP_COMMAND = np.array([0.3, 0.0, 0.0])  # command that makes the robot jump
MIN_JUMP_M = 0.2  # farther than this from its start the robot has left the ground
LANDED_S = 1.5  # time after which it stands again
JUMP_S = 3.0  # approximate duration of a jump


class Act(NamedTuple):
    """Output of an activity: request and progress."""

    request: Request
    remaining_s: float
    done: bool = False
    error_m: float = math.nan  # distance from the desired position
    trouble: str = ""  # reason for giving up


class Now(NamedTuple):
    """Input of an activity."""

    time_s: float  # since the start of the step
    pose: Pose  # in the mission's frame, yaw not wrapped
    policy: str  # policy in control


class Activity(Protocol):
    """A step that is being carried out."""

    def act(self, now: Now) -> Act:
        """Called at each policy step."""
        ...


@dataclass
class Hold:
    """Send a request for some time."""

    request: Request
    for_s: float

    def act(self, now: Now) -> Act:
        remaining_s = self.for_s - now.time_s
        return Act(self.request, max(0.0, remaining_s), done=remaining_s <= 0.0)


@dataclass
class Cover:
    """Walk with a velocity until the robot has covered a distance."""

    velocity: np.ndarray
    distance_m: float
    begin: Pose

    def act(self, now: Now) -> Act:
        left_m = self.distance_m - distance(self.begin, now.pose)
        speed = math.hypot(self.velocity[0], self.velocity[1])
        return Act(Request(self.velocity), max(0.0, left_m / speed), done=left_m <= 0.0)


@dataclass
class Reach:
    """Go straight to a pose nearby while turning."""

    goal: Pose
    limits: Limits
    tracking: Tracking

    def act(self, now: Now) -> Act:
        error_m = distance(self.goal, now.pose)
        done = arrived(self.goal, now.pose, self.tracking)
        turn_s = abs(self.goal.yaw_rad - now.pose.yaw_rad) / self.limits.yaw_rad_s
        velocity = ZERO_COMMAND if done else towards(self.goal, now.pose, self.limits, self.tracking)
        trouble = _off(error_m, self.tracking)
        return Act(Request(velocity), turn_s + error_m, done, error_m, trouble)


@dataclass
class Follow:
    """Follow a path, and reach the pose at its end."""

    path: Path
    limits: Limits
    tracking: Tracking
    _index: int = field(default=0, init=False)

    def act(self, now: Now) -> Act:
        path = self.path
        self._index, error_m = nearest(path, now.pose, self._index)
        if self._index == len(path.points) - 1:
            return Reach(path.end, self.limits, self.tracking).act(now)
        turn_s = abs(float(path.heading[self._index]) - now.pose.yaw_rad) / self.limits.yaw_rad_s
        remaining_s = float(path.remaining_s[self._index]) + turn_s
        velocity = along(path, self._index, now.pose, self.limits, self.tracking)
        return Act(Request(velocity), remaining_s, error_m=error_m, trouble=_off(error_m, self.tracking))


@dataclass
class Change:
    """Change policy, gait or settings of the run; done once the policy has changed."""

    policy: str = ""
    gait: str = ""
    settings: dict[str, float] = field(default_factory=dict)

    def act(self, now: Now) -> Act:
        request = Request(
            ZERO_COMMAND, policy=self.policy, gait=self.gait, settings=self.settings or NO_SETTINGS
        )
        done = self.policy in ("", now.policy)
        late = not done and now.time_s > TAKES_OVER_S
        return Act(request, 0.0, done, trouble=f"'{self.policy}' does not take over" if late else "")


@dataclass
class Leap:
    """Jump some times with a policy that can jump, then return to the previous policy."""

    policy: str
    times: int
    _back_to: str = field(default="", init=False)
    _from: Pose | None = field(default=None, init=False)  # start of the current jump
    _since_s: float = field(default=0.0, init=False)  # start of the current phase
    _leapt: bool = field(default=False, init=False)

    def act(self, now: Now) -> Act:
        self._back_to = self._back_to or now.policy
        if not self.times:
            return self._request(now, self._back_to, done=now.policy == self._back_to)
        if now.policy != self.policy:
            return self._request(now, self.policy)
        if self._from is None:
            self._from, self._since_s, self._leapt = now.pose, now.time_s, False
        if not self._leapt and distance(self._from, now.pose) > MIN_JUMP_M:
            self._leapt, self._since_s = True, now.time_s
        if self._leapt and now.time_s - self._since_s > LANDED_S:
            self.times, self._from, self._since_s = self.times - 1, None, now.time_s
        return self._request(now, self.policy, ZERO_COMMAND if self._leapt else JUMP_COMMAND)

    def _request(self, now: Now, policy: str, velocity: np.ndarray = ZERO_COMMAND, done: bool = False) -> Act:
        late = not done and now.time_s - self._since_s > TAKES_OVER_S
        trouble = f"'{policy}' does not {'jump' if velocity.any() else 'take over'}" if late else ""
        return Act(Request(velocity, policy=policy), self.times * JUMP_S, done, trouble=trouble)


@dataclass
class LieDown:
    """Lie down, which ends the run."""

    def act(self, now: Now) -> Act:
        return Act(Request(ZERO_COMMAND, Behaviour.LIE_DOWN), 0.0, done=True)


def _off(error_m: float, tracking: Tracking) -> str:
    return f"it is {error_m:.2f} m away from the path" if error_m > tracking.off_path_m else ""
