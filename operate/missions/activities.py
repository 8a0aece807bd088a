"""Activities of a mission's steps: each computes a command from the pose at each policy step."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from footfall.deploy.command_source import NO_SETTINGS, ZERO_COMMAND, Behaviour, Pose, Request
from footfall.operate.abilities import Limits
from footfall.operate.missions.follow import (
    Tracking,
    arrived,
    command_along,
    command_towards,
    distance,
    nearest,
)
from footfall.operate.missions.path import Path

TAKE_OVER_TIMEOUT_S = 10.0  # maximum time for a policy to take over, or to start a jump
JUMP_COMMAND = np.array([0.3, 0.0, 0.0])  # command that makes the robot jump
MIN_JUMP_M = 0.2  # beyond this distance from the jump's start the robot has taken off
LANDED_S = 1.5  # time from take-off until the robot stands again
JUMP_S = 3.0  # approximate duration of a jump
APPROACH_M_S = 1.0  # assumed speed to a pose nearby, for the remaining time


class Output(NamedTuple):
    """Output of an activity: request and progress."""

    request: Request
    remaining_s: float
    done: bool = False
    error_m: float = math.nan  # distance from the desired position
    failure: str = ""  # reason for giving up


class Input(NamedTuple):
    """Input of an activity."""

    time_s: float  # since the start of the step
    pose: Pose  # in the mission's frame, yaw not wrapped
    policy: str  # policy in control


class Activity(Protocol):
    """A step that is being carried out."""

    def act(self, now: Input) -> Output:
        """Called at each policy step."""
        ...


@dataclass
class Hold:
    """Send a request for some time."""

    request: Request
    for_s: float

    def act(self, now: Input) -> Output:
        remaining_s = self.for_s - now.time_s
        return Output(self.request, max(0.0, remaining_s), done=remaining_s <= 0.0)


@dataclass
class Cover:
    """Walk with a velocity until the robot has covered a distance."""

    velocity: np.ndarray
    distance_m: float
    begin: Pose

    def act(self, now: Input) -> Output:
        remaining_m = self.distance_m - distance(self.begin, now.pose)
        speed = math.hypot(self.velocity[0], self.velocity[1])
        return Output(Request(self.velocity), max(0.0, remaining_m / speed), done=remaining_m <= 0.0)


@dataclass
class Reach:
    """Go straight to a pose nearby while turning."""

    goal: Pose
    limits: Limits
    tracking: Tracking

    def act(self, now: Input) -> Output:
        error_m = distance(self.goal, now.pose)
        done = arrived(self.goal, now.pose, self.tracking)
        turn_s = abs(self.goal.yaw_rad - now.pose.yaw_rad) / self.limits.yaw_rad_s
        velocity = ZERO_COMMAND if done else command_towards(self.goal, now.pose, self.limits, self.tracking)
        failure = _off_path(error_m, self.tracking)
        remaining_s = turn_s + error_m / APPROACH_M_S
        return Output(Request(velocity), remaining_s, done, error_m, failure)


@dataclass
class Follow:
    """Follow a path, and reach the pose at its end."""

    path: Path
    limits: Limits
    tracking: Tracking
    _index: int = field(default=0, init=False)

    def act(self, now: Input) -> Output:
        path = self.path
        self._index, error_m = nearest(path, now.pose, self._index)
        if self._index == len(path.points) - 1:
            return Reach(path.end, self.limits, self.tracking).act(now)
        turn_s = abs(float(path.heading[self._index]) - now.pose.yaw_rad) / self.limits.yaw_rad_s
        remaining_s = float(path.remaining_s[self._index]) + turn_s
        velocity = command_along(path, self._index, now.pose, self.limits, self.tracking)
        return Output(
            Request(velocity), remaining_s, error_m=error_m, failure=_off_path(error_m, self.tracking)
        )


@dataclass
class Change:
    """Change policy, gait or settings of the run; done once the policy has changed."""

    policy: str = ""
    gait: str = ""
    settings: dict[str, float] = field(default_factory=dict)

    def act(self, now: Input) -> Output:
        request = Request(
            ZERO_COMMAND, policy=self.policy, gait=self.gait, settings=self.settings or NO_SETTINGS
        )
        done = self.policy in ("", now.policy)
        timed_out = not done and now.time_s > TAKE_OVER_TIMEOUT_S
        return Output(request, 0.0, done, failure=f"'{self.policy}' does not take over" if timed_out else "")


@dataclass
class Leap:
    """Jump several times with a policy that can jump, then return to the previous policy."""

    policy: str
    remaining_jumps: int
    _previous_policy: str = field(default="", init=False)
    _jump_start: Pose | None = field(default=None, init=False)  # start of the current jump
    _phase_start_s: float = field(default=0.0, init=False)  # start of the current phase
    _taken_off: bool = field(default=False, init=False)

    def act(self, now: Input) -> Output:
        self._previous_policy = self._previous_policy or now.policy
        if not self.remaining_jumps:
            return self._request(now, self._previous_policy, done=now.policy == self._previous_policy)
        if now.policy != self.policy:
            return self._request(now, self.policy)
        if self._jump_start is None:
            self._jump_start, self._phase_start_s, self._taken_off = now.pose, now.time_s, False
        if not self._taken_off and distance(self._jump_start, now.pose) > MIN_JUMP_M:
            self._taken_off, self._phase_start_s = True, now.time_s
        if self._taken_off and now.time_s - self._phase_start_s > LANDED_S:
            self.remaining_jumps -= 1
            self._jump_start, self._phase_start_s = None, now.time_s
        return self._request(now, self.policy, ZERO_COMMAND if self._taken_off else JUMP_COMMAND)

    def _request(
        self, now: Input, policy: str, velocity: np.ndarray = ZERO_COMMAND, done: bool = False
    ) -> Output:
        timed_out = not done and now.time_s - self._phase_start_s > TAKE_OVER_TIMEOUT_S
        failure = f"'{policy}' does not {'jump' if velocity.any() else 'take over'}" if timed_out else ""
        return Output(Request(velocity, policy=policy), self.remaining_jumps * JUMP_S, done, failure=failure)


@dataclass
class LieDown:
    """Lie down, which ends the run."""

    def act(self, now: Input) -> Output:
        return Output(Request(ZERO_COMMAND, Behaviour.LIE_DOWN), 0.0, done=True)


def _off_path(error_m: float, tracking: Tracking) -> str:
    return f"it is {error_m:.2f} m away from the path" if error_m > tracking.off_path_m else ""
