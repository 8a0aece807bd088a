"""Missions as scenarios: the interface that an evaluation needs, and the score.

Missions belong to `operate`, which `evaluate` does not import: the caller passes the function that makes one
(`EvaluationConfig.mission_run`; the command line passes `operate.missions.run.mission_run`).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from footfall.common.config import read_yaml
from footfall.common.errors import UserError
from footfall.common.limits import MAX_DURATION_S
from footfall.common.rotations import heading, heading_matrix
from footfall.deploy.command_source import CommandSource, Pose
from footfall.evaluate.scenarios import Scenario
from footfall.evaluate.statistics import wilson_interval
from footfall.plant.trace import Trace
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

MAX_GOAL_DISTANCE_M = 0.10  # largest distance from a mission's goal that counts as arrived
EPISODES = 5  # of a scenario from a mission's file


class MissionProgress(Protocol):
    """Progress of a mission."""

    @property
    def done(self) -> bool:
        """Whether all steps are done."""

    @property
    def outcome(self) -> str:
        """Why the mission gave up; empty while it runs and after success."""


class MissionSource(CommandSource, Protocol):
    """A mission as a command source."""

    @property
    def progress(self) -> MissionProgress:
        """Its progress."""

    @property
    def goal(self) -> Pose:
        """Target pose of the latest step that moves the robot, relative to the mission's start."""


class MissionRun(Protocol):
    """A mission before its start."""

    @property
    def source(self) -> MissionSource:
        """The command source."""

    @property
    def others(self) -> Mapping[str, Policy]:
        """Policies that it names besides the first one, by spec."""


class MakeMission(Protocol):
    """Makes a mission from plain data. A function of a module, so that another process finds it."""

    def __call__(
        self, data: Mapping[str, Any], where: str, spec: str, policy: Policy, robot: Robot
    ) -> MissionRun:
        """The mission; `where` begins each message, `spec` names the policy that runs at first.

        Raises:
            UserError: the data is not a mission, or a step cannot be done.
        """


def make_mission(
    make: MakeMission | None, data: Mapping[str, Any], scenario: str, spec: str, policy: Policy, robot: Robot
) -> MissionRun:
    """The mission of a scenario.

    Raises:
        UserError: `make` is None, the data is not a mission, or a step cannot be done.
    """
    if make is None:
        raise UserError(
            f"scenario '{scenario}' is a mission: set EvaluationConfig.mission_run"
            " to footfall.operate.missions.run.mission_run"
        )
    return make(data, f"scenario '{scenario}'", spec, policy, robot)


@dataclass(frozen=True)
class MissionScore:
    """Result of a mission."""

    done: bool
    trouble: str  # why it gave up; empty after success or a fall
    lasted_s: float  # of walking
    final_error_m: float  # true distance from the goal, at the end

    @property
    def arrived(self) -> bool:
        """Whether it is done and ended at its goal."""
        return self.done and self.final_error_m <= MAX_GOAL_DISTANCE_M


def score_mission(source: MissionSource, trace: Trace) -> MissionScore:
    """The score of a mission whose episode is over, from ground truth."""
    progress = source.progress
    done = progress.done and not trace.fell
    timeout = "" if trace.fell or trace.faults else "the mission is not over in time"
    trouble = "" if done else progress.outcome or timeout
    if not len(trace.time_s):
        return MissionScore(done, trouble, 0.0, math.nan)
    yaw = float(heading(trace.base_quaternion[0]))
    displacement = heading_matrix(-yaw) @ (trace.base_position[-1] - trace.base_position[0])
    error = displacement[:2] - source.goal[:2]
    return MissionScore(done, trouble, float(trace.time_s[-1]), float(np.hypot(*error)))


def mission_figures(scores: Sequence[MissionScore]) -> dict[str, Any]:
    """Figures of one scenario; errors and times are of completed missions, NaN without any."""
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
    """The scenario of a mission's file.

    Raises:
        UserError: it cannot be read, or holds no mapping.
    """
    data = read_yaml(path)
    if not isinstance(data, dict):
        raise UserError(f"{path}: a mission has a list of steps, such as steps: [{{rectangle: 2x1}}]")
    return Scenario(str(data.get("about") or f"The mission {path}"), EPISODES, MAX_DURATION_S, mission=data)
