"""Missions as scenarios: what an evaluation needs of one, and its score.

Missions are of `operate`, which an evaluation does not import: its caller hands in what makes one
(`EvaluationConfig.mission_run`; the command line gives `operate.missions.run.mission_run`).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from footfall.common.config import read_yaml
from footfall.common.errors import UserError
from footfall.common.limits import LONGEST_S
from footfall.common.rotations import heading, heading_matrix
from footfall.deploy.command_source import CommandSource, Pose
from footfall.evaluate.scenarios import Scenario
from footfall.evaluate.statistics import wilson_interval
from footfall.plant.trace import Trace
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

ARRIVED_M = 0.10  # at most from the place that a mission leads to
EPISODES = 5  # of a mission's file


class MissionProgress(Protocol):
    """How far a mission is."""

    @property
    def done(self) -> bool:
        """Whether all of it was done."""

    @property
    def outcome(self) -> str:
        """Empty until it is over; then why it gave up, unless it is done."""


class MissionSource(CommandSource, Protocol):
    """A mission that steers."""

    @property
    def progress(self) -> MissionProgress:
        """How far it is."""

    @property
    def goal(self) -> Pose:
        """Where its latest step that moves the robot leads, in the frame of where the mission began."""


class MissionRun(Protocol):
    """A mission that has not begun."""

    @property
    def source(self) -> MissionSource:
        """What steers."""

    @property
    def others(self) -> Mapping[str, Policy]:
        """Policies that it names beside the first one, by spec."""


class MakeMission(Protocol):
    """Makes a mission from plain data. A function of a module, so that another process finds it."""

    def __call__(
        self, data: Mapping[str, Any], where: str, spec: str, policy: Policy, robot: Robot
    ) -> MissionRun:
        """The mission; `where` begins each message, `spec` names the policy that decides at first.

        Raises:
            UserError: the data is no mission, or a step cannot be done.
        """


def make_mission(
    make: MakeMission | None, data: Mapping[str, Any], scenario: str, spec: str, policy: Policy, robot: Robot
) -> MissionRun:
    """The mission of a scenario.

    Raises:
        UserError: nothing makes missions here, the data is no mission, or a step cannot be done.
    """
    if make is None:
        raise UserError(
            f"scenario '{scenario}' is a mission: set EvaluationConfig.mission_run"
            " to footfall.operate.missions.run.mission_run"
        )
    return make(data, f"scenario '{scenario}'", spec, policy, robot)


@dataclass(frozen=True)
class MissionScore:
    """How a mission ended."""

    done: bool
    trouble: str  # why it gave up; empty if it is done, or the robot fell
    lasted_s: float  # of walking
    final_error_m: float  # true distance from where it leads, at the end

    @property
    def arrived(self) -> bool:
        """Whether it is done, and ended where it leads."""
        return self.done and self.final_error_m <= ARRIVED_M


def score_mission(source: MissionSource, trace: Trace) -> MissionScore:
    """The score of a mission whose episode is over, from ground truth."""
    progress = source.progress
    done = progress.done and not trace.fell
    late = "" if trace.fell or trace.faults else "the mission is not over in time"
    trouble = "" if done else progress.outcome or late
    if not len(trace.time_s):
        return MissionScore(done, trouble, 0.0, math.nan)
    yaw = float(heading(trace.base_quaternion[0]))
    moved = heading_matrix(-yaw) @ (trace.base_position[-1] - trace.base_position[0])
    off = moved[:2] - source.goal[:2]
    return MissionScore(done, trouble, float(trace.time_s[-1]), float(np.hypot(*off)))


def mission_figures(scores: Sequence[MissionScore]) -> dict[str, Any]:
    """Figures of one scenario; errors and times are of missions that were done, NaN without one."""
    done = [score for score in scores if score.done]
    arrived = sum(score.arrived for score in scores)
    return {
        "missions_done": len(done),
        "missions_arrived": arrived,
        "arrival_rate_interval": wilson_interval(arrived, len(scores)),
        "final_error_m": max((score.final_error_m for score in done), default=math.nan),
        "mission_s": float(np.mean([score.lasted_s for score in done])) if done else math.nan,
    }


def scenario_of(path: Path) -> Scenario:
    """A mission's file as a scenario.

    Raises:
        UserError: it cannot be read, or holds no mapping.
    """
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise UserError(f"{path}: a mission has a list of steps, such as steps: [{{rectangle: 2x1}}]")
    return Scenario(str(data.get("about") or f"The mission {path}"), EPISODES, LONGEST_S, mission=data)
