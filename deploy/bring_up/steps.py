"""Steps of bring-up, from holding a pose to walking: each must pass before the next one starts."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from footfall.deploy.bring_up.config import BringUpConfig
from footfall.deploy.bring_up.criteria import (
    Case,
    Criterion,
    Window,
    calm,
    carry,
    cool,
    follow,
    level,
    modest,
    sway,
    upright,
)
from footfall.deploy.bring_up.motions import (
    SlewedIn,
    StandingTrajectoryPolicy,
    TrajectoryPolicy,
    one_after_the_other,
    still,
    swaying,
)
from footfall.deploy.bring_up.recording import Recording
from footfall.deploy.bus import Bus
from footfall.deploy.command_source import CommandSource, VelocityFunction
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import ControlLoop
from footfall.deploy.session import Session, SessionResult, run_session
from footfall.deploy.wiring import wiring_of
from footfall.deploy.wiring_check.verdict import Verdict as WiringVerdict
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

SAMPLE_EVERY = 2  # ticks


class Setting(NamedTuple):
    """Robot, policy and settings for all steps."""

    robot: Robot
    policy: Policy  # for the last two steps
    command_source: CommandSource | VelocityFunction  # for the last two steps
    config: BringUpConfig
    deploy: DeployConfig  # its `scale` applies to every step
    realtime: bool = True
    on_wiring_passed: Callable[[Sequence[WiringVerdict]], None] = lambda _: None  # called after success

    @property
    def gains(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and damping while standing, (n,) each."""
        return self.deploy.stand_kp_scale * self.robot.kp, self.deploy.stand_kd_scale * self.robot.kd


class Plan(NamedTuple):
    """Policy of a step, and the consecutive windows in which it is tested."""

    policy: Policy
    windows: list[Window]
    command_source: CommandSource | VelocityFunction = lambda _: np.zeros(3)


class Step(NamedTuple):
    """One step: support of the robot, motion and criteria."""

    name: str
    hangs: bool  # in a frame, with the feet in the air; otherwise it lies or stands on the ground
    about: str
    plan: Callable[[Setting], Plan]
    criteria: tuple[Criterion, ...]
    min_feet: int = 1  # a robot with fewer feet skips the step
    stands_still: bool = False  # a robot that cannot stand still (`held_start`) skips the step
    checks_wiring: bool = False
    uneven: bool = False  # with obstacles of height `uneven_m`

    def skipped_by(self, robot: Robot) -> str:
        """Why a robot skips the step; empty if it does not."""
        if len(robot.description.feet) < self.min_feet:
            return f"it needs {self.min_feet} feet"
        if self.stands_still and robot.description.held_start:
            return f"{robot.name} cannot stand still"
        return ""


class Verdict(NamedTuple):
    """Result of a step."""

    step: str
    findings: tuple[str, ...]  # reasons of a failure; empty if passed
    outcome: SessionResult

    @property
    def passed(self) -> bool:
        return not self.findings


def _hold(setting: Setting) -> Plan:
    policy = TrajectoryPolicy(still(setting.robot), *setting.gains)
    return Plan(policy, [Window(0.0, setting.config.hold_s)])


def _move(setting: Setting, groups: list[np.ndarray]) -> Plan:
    config, each_s = setting.config, setting.config.move_s
    trajectory = one_after_the_other(setting.robot, groups, config.move_rad, each_s)
    windows = [
        Window(index * each_s, (index + 1) * each_s, tuple(group.tolist()))
        for index, group in enumerate(groups)
    ]
    return Plan(TrajectoryPolicy(trajectory, *setting.gains), windows)


def _move_joints(setting: Setting) -> Plan:
    return _move(setting, [np.array([joint]) for joint in range(len(setting.robot.joint_names))])


def _move_legs(setting: Setting) -> Plan:
    return _move(setting, list(setting.robot.foot_joints))


def _stand(setting: Setting) -> Plan:
    robot = setting.robot
    return Plan(
        StandingTrajectoryPolicy(robot, still(robot), *setting.gains), [Window(0.0, setting.config.hold_s)]
    )


def _sway(setting: Setting) -> Plan:
    robot, config = setting.robot, setting.config
    trajectory, each_s = swaying(robot, config.sway_rad, config.move_s), config.move_s
    windows = [
        Window(index * each_s, (index + 1) * each_s, sway_axis=axis)
        for index, axis in enumerate(("roll", "pitch"))
    ]
    return Plan(StandingTrajectoryPolicy(robot, trajectory, *setting.gains), windows)


def _walk(setting: Setting) -> Plan:
    config = setting.config
    policy = SlewedIn(setting.policy, setting.robot, config.slew_s, *setting.gains)
    return Plan(policy, [Window(0.0, config.slew_s + config.walk_s)], setting.command_source)


ALWAYS = (calm, modest, cool)
STEPS = (
    Step("hold", True, "the joints hold their initial pose", _hold, (follow, *ALWAYS)),
    Step("joints", True, "each joint moves in turn, and no other", _move_joints, (follow, *ALWAYS)),
    Step("legs", True, "each leg moves in turn", _move_legs, (follow, *ALWAYS)),
    Step("wiring", False, "each joint moves slightly in turn, lying and standing", _stand, ALWAYS,
         stands_still=True, checks_wiring=True),
    Step("stand", False, "the robot stands", _stand, (level, carry, *ALWAYS), stands_still=True),
    Step("shift", False, "the robot shifts its weight; the IMU agrees", _sway, (sway, *ALWAYS), min_feet=3),
    Step("walk", False, "control fades to the policy", _walk, (cool,)),
    Step("uneven", False, "the policy walks over uneven ground", _walk, (upright, cool), uneven=True),
)  # fmt: skip


class _Judge:
    """Records a run, tests each window at its end, and ends the run at the first finding."""

    def __init__(self, setting: Setting, step: Step, plan: Plan) -> None:
        wiring = wiring_of(setting.robot)
        self._labels = [wiring.label(joint) for joint in range(len(setting.robot.joint_names))]
        self._setting, self._step, self._pending = setting, step, list(plan.windows)
        self._recording, self._ticks = Recording(), 0
        self.findings: list[str] = []

    def tick(self, loop: ControlLoop) -> None:
        """Record and test; called after each joint tick."""
        self._ticks += 1
        if not loop.walking or self._ticks % SAMPLE_EVERY:
            return
        self._recording.add(loop)
        error = np.abs(loop.target - loop.sensed.joint_position)
        joint = int(error.argmax())
        if self._step.hangs and error[joint] > self._setting.config.limits.lost_rad:
            self.findings.append(f"{self._labels[joint]} is {error[joint]:.2f} rad away from its target")
        while self._pending and loop.walking_s >= self._pending[0].end_s - 1e-9:
            self._judge(self._pending.pop(0))
        if self.findings:
            loop.finish(skip_lie_down=True)

    def _judge(self, window: Window) -> None:
        setting, samples = self._setting, self._recording.between(window.begin_s, window.end_s)
        case = Case(setting.robot, self._labels, window, samples, setting.config.limits)
        for criterion in self._step.criteria:
            self.findings += criterion(case)

    def verdict(self, outcome: SessionResult) -> Verdict:
        """Result of the whole run, with the supervisor's faults first."""
        findings = [*outcome.faults, *self.findings]
        if not findings and self._pending:
            findings = ["it ended early"]
        return Verdict(self._step.name, tuple(findings), outcome)


def run_step(step: Step, setting: Setting, bus: Bus) -> Verdict:
    """Run one step of bring-up, from disabled motors to disabled motors.

    Args:
        step: step to run.
        setting: robot, policy and settings.
        bus: bus to the robot, which must hang or be on the ground as the step requires.

    Raises:
        UserError: policy, robot and settings do not fit; nothing has moved in this case.
    """
    plan = step.plan(setting)
    judge = _Judge(setting, step, plan)
    session = Session(
        command_source=plan.command_source,
        duration_s=plan.windows[-1].end_s + 0.05,  # so that the last window is tested
        realtime=setting.realtime,
        config=setting.deploy,
        stand_up=not step.hangs,
        lie_down=not step.hangs,
        check_wiring=step.checks_wiring,
        stop_inputs=setting.realtime,
        on_wiring_passed=setting.on_wiring_passed,
    )
    outcome = run_session(setting.robot, plan.policy, bus, session, judge.tick)
    return judge.verdict(outcome)
