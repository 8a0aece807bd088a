"""An inbox that also walks along paths requested by its bridge, using odometry."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.command_source import ZERO_COMMAND, Request, Status, Stop
from footfall.deploy.modes import Mode
from footfall.operate.abilities import Abilities
from footfall.operate.inbox import Inbox
from footfall.operate.missions.mission import Mission, mission_of
from footfall.operate.missions.source import MissionSource


class PathState(NamedTuple):
    """Progress of a walk along a path."""

    goal: int  # number chosen by the requester
    distance_m: float  # straight distance to the end
    outcome: str = ""  # at the end: `missions.source.DONE`, or the reason for giving up


class _Walk:
    """One path: given in `odom`, and from the next poll on a mission in the frame of its start."""

    def __init__(self, points: Any, yaw_rad: float | None, goal: int) -> None:
        _mission(points, yaw_rad)  # raises an error if it is not a path
        self.points, self.yaw_rad = np.array(points, dtype=float), yaw_rad
        self.mission: MissionSource | None = None
        self.state = PathState(goal, math.nan)

    def begin(self, status: Status, abilities: Callable[[str], Abilities]) -> MissionSource:
        pose = status.pose
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        local = (self.points - pose[:2]) @ np.array([[cos, -sin], [sin, cos]])
        yaw = None if self.yaw_rad is None else self.yaw_rad - pose.yaw_rad
        return MissionSource(_mission(local.tolist(), yaw), status.policy, abilities)


class PathSource:
    """A command source: an inbox, and a path that may send requests as its owner.

    A nonzero velocity of the same operator ends the walk; zero velocities are ignored during it, since
    planners send them all the time. The inbox's rules for silence apply: the walk sends requests to it.
    """

    def __init__(self, inbox: Inbox, operator: str, abilities: Callable[[str], Abilities]) -> None:
        """Start without a path.

        Args:
            inbox: inbox of the run.
            operator: name in the inbox of the operator who walks along paths.
            abilities: returns the abilities of a policy of the run by its name.
        """
        self._inbox, self._operator, self._abilities = inbox, operator, abilities
        self._walk: _Walk | None = None

    @property
    def state(self) -> PathState | None:
        """State of the newest path; None if there was none, or it was ended by a velocity or its operator."""
        walk = self._walk
        return None if walk is None else walk.state

    def follow(self, points: Any, yaw_rad: Any = None, goal: int = 0) -> str:
        """Walk along points (n, 2), m, in `odom`, and turn to a heading at the end; replaces an earlier path.

        Returns:
            Why it is refused, in one line; empty if it is accepted.
        """
        try:
            walk = _Walk(points, yaw_rad, goal)
        except (UserError, TypeError, ValueError) as error:
            return str(error)
        refused = self._inbox.put(self._operator, velocity=ZERO_COMMAND)
        if not refused:
            self._walk = walk
        return refused

    def leave(self) -> None:
        """End the path and stand."""
        if self._walk is not None:
            self._walk = None
            self._inbox.put(self._operator, velocity=ZERO_COMMAND)

    def put(self, **request: Any) -> str:
        """`Inbox.put` for the operator."""
        walk = self._walk
        if walk is not None and not walk.state.outcome and "velocity" in request:
            if request["velocity"] in ([0, 0, 0], (0, 0, 0)):
                del request["velocity"]
            else:
                self._walk = None
        return self._inbox.put(self._operator, **request)

    # -- called by the loop --------------------------------------------------------------------------

    @property
    def stopped(self) -> Stop | None:
        """See `Inbox.stopped`."""
        return self._inbox.stopped

    def poll(self, status: Status) -> Request:
        """The newest request of the inbox; the walk writes to it."""
        walk = self._walk
        if walk is not None and not walk.state.outcome:
            self._step_walk(walk, status)
        return self._inbox.poll(status)

    def _step_walk(self, walk: _Walk, status: Status) -> None:
        """Send the walk's velocity to the inbox, if the robot can walk."""
        if status.mode is not Mode.WALKING:
            return
        velocity, outcome = ZERO_COMMAND, "there is no odometry"
        if math.isfinite(status.pose.x_m):
            try:
                if walk.mission is None:
                    walk.mission = walk.begin(status, self._abilities)
                velocity = walk.mission.poll(status).velocity
                outcome = walk.mission.progress.outcome
            except UserError as error:
                outcome = str(error)
        refused = self._inbox.put(self._operator, velocity=velocity)
        distance_m = math.dist(status.pose[:2], walk.points[-1])
        walk.state = walk.state._replace(distance_m=distance_m, outcome=outcome or refused)


def _mission(points: Any, yaw_rad: Any) -> Mission:
    """The mission for walking along points.

    Raises:
        UserError: they are not a path.
    """
    heading = {} if yaw_rad is None else {"heading_deg": math.degrees(yaw_rad)}
    steps = [{"waypoints": {"points": points, **heading}}]
    return mission_of({"steps": steps, "low_charge": 0.0}, "path")  # the requester checks the battery
