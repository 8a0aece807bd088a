"""A mission as the command source of a run."""

import math
from collections.abc import Callable
from typing import NamedTuple

from footfall.common.errors import UserError
from footfall.deploy.command_source import ZERO_COMMAND, Behaviour, Pose, Request, Status
from footfall.deploy.modes import Mode
from footfall.operate.abilities import Abilities
from footfall.operate.missions.activities import Input, Output
from footfall.operate.missions.courses import MAX_PATH_M, GoTo, OdometryStep
from footfall.operate.missions.mission import HERE, Mission, NamedStep
from footfall.operate.missions.step import Plan
from footfall.operate.missions.steps import End

TIMEOUT_FACTOR, TIMEOUT_EXTRA_S = 3.0, 10.0  # for a step that uses odometry and has no timeout
PROGRESS_S = 0.2  # minimum decrease of the remaining time that counts as progress
DONE = "done"
HOME_STEP_M = 0.9 * MAX_PATH_M  # longest step on the way home: it begins where the robot came to rest
LIE_DOWN = (NamedStep("lie_down", End()),)


class Progress(NamedTuple):
    """Progress of a mission."""

    step: int  # from 1; 0 before the first one
    steps: int
    kind: str  # of the step
    step_remaining_s: float  # approximate
    remaining_s: float  # of the whole mission, approximate
    error_m: float  # distance from the desired position, by odometry, in the last step that has one
    outcome: str = ""  # at the end: `DONE`, or the reason for giving up

    @property
    def done(self) -> bool:
        """Whether the whole mission was carried out."""
        return self.outcome == DONE


class MissionSource:
    """Carries out a mission. It depends only on the statuses passed to it."""

    stopped = None  # a mission never requests a stop: it ends with lying down

    def __init__(self, mission: Mission, policy: str, abilities: Callable[[str], Abilities]) -> None:
        """Check the mission; it has not started.

        Args:
            mission: the mission.
            policy: name of the policy in control at the start.
            abilities: returns the abilities of a policy of the run by its name.

        Raises:
            UserError: a step is impossible; the message names it.
        """
        self._mission, self._abilities, self._steps = mission, abilities, mission.steps
        durations_s = mission.planned_s(policy, abilities)
        self._later_steps_s = [sum(durations_s[number:]) for number in range(1, len(durations_s) + 1)]
        self._index = -1
        self._plan: Plan | None = None
        self._origin: Pose | None = None
        self._yaw = 0.0  # in the mission's frame, not wrapped
        self._began_s = self._min_remaining_s = self._progress_s = 0.0
        self._request = Request(ZERO_COMMAND, autonomous=True, owner=f"mission {mission.source}")
        self._charge_low = False
        self.progress = Progress(0, len(mission.steps), "", math.nan, sum(durations_s), math.nan)
        self.goal = HERE  # target of the latest step that moves the robot, in the mission's frame

    def poll(self, status: Status) -> Request:
        """The request of the current step; advances past completed steps."""
        if status.mode is not Mode.WALKING or self.progress.outcome:
            return self._request
        if math.isnan(status.pose.x_m):
            return self._end("there is no odometry")
        try:
            return self._advance(status, self._pose(status.pose))
        except (UserError, ValueError) as error:  # planning from the current pose failed
            return self._end(str(error))

    def _advance(self, status: Status, pose: Pose) -> Request:
        if status.charge <= self._mission.settings.low_charge and not self._charge_low:
            self._charge_low = True
            go_home = self._mission.settings.on_low_charge == "home"
            self._replace_steps((*_way_home(pose), *LIE_DOWN) if go_home else LIE_DOWN)
            note = f"low battery ({status.charge:.0%}): the mission goes on with '{self._steps[0].kind}'"
            self._request = self._request._replace(note=note)
        while True:
            if self._plan is None:
                self._begin(self._index + 1, status, pose)
            assert self._plan is not None
            output = self._plan.activity.act(Input(status.walking_s - self._began_s, pose, status.policy))
            self._apply(output)
            if failure := output.failure or self._stalled(output, status.walking_s):
                return self._end(failure)
            if not output.done:
                return self._request
            if self._index == len(self._steps) - 1:
                return self._end(DONE)
            self._plan = None

    def _replace_steps(self, steps: tuple[NamedStep, ...]) -> None:
        """Replace the remaining steps."""
        self._steps, self._index, self._plan = steps, -1, None
        self._later_steps_s = [0.0] * len(steps)

    def _begin(self, index: int, status: Status, pose: Pose) -> None:
        self._index = index
        step, limits = self._steps[index].step, self._abilities(status.policy).limits
        self._plan = step.plan(pose, self._mission.scene(limits))
        if isinstance(step, OdometryStep) or self._plan.end != pose:
            self.goal = self._plan.end
        self._began_s = self._progress_s = status.walking_s
        self._min_remaining_s = math.inf

    def _apply(self, output: Output) -> None:
        before, new = self._request, output.request
        self._request = new._replace(
            policy=new.policy or before.policy,
            gait=new.gait or ("" if new.policy else before.gait),
            settings=new.settings or ({} if new.policy else before.settings),
            note=new.note or before.note,
            autonomous=True,
            owner=before.owner,
        )
        self.progress = Progress(
            self._index + 1,
            len(self._steps),
            self._steps[self._index].kind,
            output.remaining_s,
            output.remaining_s + self._later_steps_s[self._index],
            self.progress.error_m if math.isnan(output.error_m) else output.error_m,
        )

    def _stalled(self, output: Output, now_s: float) -> str:
        """Why a step that uses odometry has failed; empty if it has not."""
        step = self._steps[self._index].step
        if not isinstance(step, OdometryStep):
            return ""
        if output.remaining_s < self._min_remaining_s - PROGRESS_S:
            self._min_remaining_s, self._progress_s = output.remaining_s, now_s
        blocked_s = self._mission.settings.tracking.blocked_s
        if now_s - self._progress_s > blocked_s:
            return f"no progress for {blocked_s:g} s: it is blocked"
        assert self._plan is not None
        limit_s = step.timeout_s or TIMEOUT_FACTOR * self._plan.duration_s + TIMEOUT_EXTRA_S
        return f"it takes longer than {limit_s:.0f} s" if now_s - self._began_s > limit_s else ""

    def _end(self, outcome: str) -> Request:
        """End the mission: the robot lies down."""
        note = self._request.note
        if outcome != DONE:
            place = "before the first step"
            if self._index >= 0:
                place = f"at step {self._index + 1} ({self._steps[self._index].kind})"
            outcome = f"gave up {place}: {outcome}"
            note = f"the mission {outcome}"
        self.progress = self.progress._replace(outcome=outcome, step_remaining_s=0.0, remaining_s=0.0)
        self._request = self._request._replace(velocity=ZERO_COMMAND, behaviour=Behaviour.LIE_DOWN, note=note)
        return self._request

    def _pose(self, pose: Pose) -> Pose:
        """The pose in the mission's frame, with a continuous yaw."""
        if self._origin is None:
            self._origin = pose
        x, y, yaw = self._origin
        self._yaw += math.remainder(pose.yaw_rad - yaw - self._yaw, 2 * math.pi)
        cos, sin = math.cos(yaw), math.sin(yaw)
        dx, dy = pose.x_m - x, pose.y_m - y
        return Pose(cos * dx + sin * dy, cos * dy - sin * dx, self._yaw)


def _way_home(pose: Pose) -> tuple[NamedStep, ...]:
    """Steps that walk straight to the mission's origin, none longer than a path may be."""
    count = max(1, math.ceil(math.hypot(pose.x_m, pose.y_m) / HOME_STEP_M))
    shares = (left / count for left in reversed(range(count)))  # of the way that remains after each step
    return tuple(NamedStep("go_to", GoTo((share * pose.x_m, share * pose.y_m))) for share in shares)
