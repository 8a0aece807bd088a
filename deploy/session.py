"""One run of a policy on a robot, on any bus: stand up, walk, lie down, damp, disable the motors."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from footfall.common.config import unstructure
from footfall.common.errors import UserError
from footfall.common.limits import MAX_DURATION_S
from footfall.deploy.base_estimate import BaseEstimate, BaseStateFunction
from footfall.deploy.bus import Bus, BusStatistics
from footfall.deploy.clock import Clock, LockstepClock, WallClock
from footfall.deploy.command_source import CommandSource, StopSource, VelocityFunction, source_of
from footfall.deploy.config import DeployConfig
from footfall.deploy.deadline import Arm, deadlines, unarmed
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.fit import check_contract, check_get_up, check_joint_rate
from footfall.deploy.handover import Handover
from footfall.deploy.height_scan import HeightScanSource, height_scans_of
from footfall.deploy.log_store import LogStore
from footfall.deploy.logged_bus import LoggedBus
from footfall.deploy.loop import ControlLoop
from footfall.deploy.policy_runner import PolicyRunner
from footfall.deploy.process_end import ending_on_signals, exit_raises
from footfall.deploy.recovery import GetUp, Recovered, Recovery
from footfall.deploy.replay import GET_UP, HANDOVER, OTHERS
from footfall.deploy.run_loop import EachTick, guarded, realtime_settings, run_loop
from footfall.deploy.steering import Steering
from footfall.deploy.stop_inputs.open import filters_of, stop_inputs
from footfall.deploy.warm_up import warm_up
from footfall.deploy.wiring import wiring_of
from footfall.deploy.wiring_check.check import WiringCheck
from footfall.deploy.wiring_check.verdict import Verdict
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

if TYPE_CHECKING:
    from footfall.deploy.log import McapLog

Display = Callable[[ControlLoop], AbstractContextManager[None]]


@dataclass(frozen=True)
class Session:
    """Settings of a run."""

    command_source: CommandSource | VelocityFunction
    duration_s: float  # maximum duration of walking
    realtime: bool = True
    log: Path | None = None
    log_store: LogStore | None = None  # stores the log, if no file was given
    log_frames: bool = False  # whether to log CAN frames, too
    feed: Path | None = None  # socket of the run's feed, see deploy/telemetry/feed.py
    facts: dict[str, Any] = field(default_factory=dict)  # additional metadata for the log
    config: DeployConfig = field(default_factory=DeployConfig)
    display: Display | None = None  # context for the duration of the run, given its loop
    lie_down: bool = True  # before the motors are disabled, if the robot and any fault permit it
    stand_up: bool = True  # False for a suspended robot: the loop holds its initial pose
    check_wiring: bool = False  # before the robot stands up and walks
    stop_sources: Sequence[StopSource] = ()  # in addition to the command source
    height_scans: HeightScanSource | None = None  # for policies that use them
    stop_inputs: bool = False  # whether to open the robot's own stop inputs, too
    others: Mapping[str, Policy] = field(default_factory=dict)  # further selectable policies, by spec
    get_up: GetUp | None = None  # permission to get up after a fall
    on_wiring_passed: Callable[[Sequence[Verdict]], None] = lambda _: None  # called after a successful check


@dataclass(frozen=True)
class SessionResult:
    """Outcome of a run, according to the robot's own sensors."""

    final_state: str  # IDLE after an orderly end, else FALLING or ESTOP
    faults: tuple[str, ...]
    walked_s: float
    run_s: float  # by the loop's clock, including standing up and damping
    wall_s: float
    compute_ms: np.ndarray  # of each policy step; in a very long run, only of the latest
    timing: dict[str, float]  # see deploy.timing.Timing.summary
    buses: tuple[BusStatistics, ...]
    notes: tuple[str, ...]  # changed parts of the request, and missing parts of the log
    recoveries: tuple[Recovered, ...]  # falls from which the robot got up
    missing_in_log: str  # missing parts of the log; empty if it is complete


def run_on_interface(robot: Robot, policy: Policy, interface: str, session: Session) -> SessionResult:
    """Run a session on CAN interfaces of one kind, as named in `robot.yaml` (see `run_session`)."""
    from footfall.deploy.interfaces import locked_interfaces

    wiring = wiring_of(robot)
    with locked_interfaces(interface, wiring.buses, filters_of(robot, wiring)) as bus:
        return run_session(robot, policy, bus, replace(session, stop_inputs=True))


def run_session(
    robot: Robot,
    policy: Policy,
    bus: Bus,
    session: Session,
    each_tick: EachTick | None = None,
    base_state: BaseStateFunction | None = None,
) -> SessionResult:
    """Stand up, walk for the session's duration, lie down, damp, disable the motors.

    Args:
        robot: the robot that the policy and the limits are for.
        policy: computes the joint commands.
        bus: connects to the robot.
        session: settings of the run.
        each_tick: called after each joint tick.
        base_state: returns the true base velocity and height, used instead of an estimate.

    Raises:
        UserError: policy, robot or log do not match; nothing has moved in this case.
        BaseException: raised by `each_tick`, or to end the program, after the motors were disabled.
    """
    if not 0.0 < session.duration_s <= MAX_DURATION_S:
        raise UserError(f"duration is {session.duration_s:g} s: it must be positive, and at most a day")
    policies, get_up = _checked_policies(robot, policy, session)
    wiring, config = wiring_of(robot), session.config
    driver = open_driver(wiring)
    check_joint_rate(wiring, driver, config.joint_rate_hz)
    with ExitStack() as resources:
        stop_sources = session.stop_sources
        if session.stop_inputs:
            bus, inputs = resources.enter_context(stop_inputs(robot, wiring, bus))
            stop_sources = (*stop_sources, *inputs)
        arm = resources.enter_context(deadlines()) if session.realtime else unarmed
        estimate = _estimate(robot, policies, config, base_state)
        runner = _policy_runner(robot, policies, get_up, session, stop_sources, arm, estimate)
        log = _open_log(robot, policy, session, resources)
        if log is not None and session.log_frames:
            bus = LoggedBus(bus, log)
        clock: Clock = (WallClock if session.realtime else LockstepClock)(config.tick_us)
        taken_over = threading.Event()
        wiring_check = None
        if session.check_wiring:
            wiring_check = WiringCheck(
                robot, wiring, driver, config, session.on_wiring_passed, in_background=session.realtime
            )
        loop = ControlLoop(
            robot,
            wiring,
            driver,
            bus,
            clock,
            config,
            runner,
            estimate,
            log,
            lie_down=session.lie_down,
            stand_up=session.stand_up,
            taken_over=taken_over.is_set,
            wiring_check=wiring_check,
            recovery=Recovery(robot, config.safety.recovery, consent=get_up is not None),
        )
        if session.realtime:
            resources.enter_context(ending_on_signals(loop.finish))
        if session.display is not None:
            resources.enter_context(session.display(loop))
        resources.enter_context(exit_raises())
        started = time.perf_counter()
        with realtime_settings(session.realtime, config.realtime_priority) as refused:
            try:
                with guarded(loop, taken_over, session.realtime, config.safety):
                    _begin(log, clock.start(), refused)
                    run_loop(loop, session.duration_s, config.damping_ticks, each_tick)
            finally:
                loop.shut_down()
        wall_s = time.perf_counter() - started
        end_notes = [*_motors_left_on(loop), *_damaged(loop)]
        missing_in_log = "" if log is None else _end(log, runner, loop.now_us, end_notes)
        return SessionResult(
            final_state=loop.state.mode.value,
            faults=loop.state.faults,
            walked_s=loop.walked_s,
            run_s=loop.now_us * 1e-6,
            wall_s=wall_s,
            compute_ms=loop.timing.policy_ms.values(),
            timing=loop.timing.summary(),
            buses=tuple(bus.statistics()),
            recoveries=tuple(loop.recovery.recovered),
            notes=(*refused, *runner.notes, *filter(None, [missing_in_log]), *end_notes),
            missing_in_log=missing_in_log,
        )


def _checked_policies(
    robot: Robot, policy: Policy, session: Session
) -> tuple[tuple[Policy, ...], Policy | None]:
    """The policies that walk, the first one first, and the get-up policy, if any.

    Raises:
        UserError: a policy does not fit the robot.
    """
    policies = (policy, *session.others.values())
    get_up = None if session.get_up is None else session.get_up.policy
    if get_up is not None:
        check_get_up(get_up, robot)
    for each in (*policies, get_up):
        if each is not None:
            check_contract(each, robot)
    return policies, get_up


def _policy_runner(
    robot: Robot,
    policies: tuple[Policy, ...],
    get_up: Policy | None,
    session: Session,
    stop_sources: Sequence[StopSource],
    arm: Arm,
    estimate: BaseEstimate,
) -> PolicyRunner:
    """The runner of a run's policies; in real time, policies used later have been warmed up."""
    config, all_policies = session.config, policies if get_up is None else (*policies, get_up)
    runner = PolicyRunner(
        Handover(policies, config.handover, get_up),
        Steering(
            source_of(session.command_source),
            policies,
            stop_sources,
            robot.description.commands,
            "" if get_up is None else get_up.name,
        ),
        config.joint_rate_hz,
        config.safety.late_limit_s,
        session.realtime,
        arm,
        height_scans_of(all_policies, session.height_scans),
        get_up,
        note_sources=[estimate],
    )
    if session.realtime:
        for other in all_policies[1:]:
            warm_up(other, robot)
    return runner


def _open_log(robot: Robot, policy: Policy, session: Session, resources: ExitStack) -> "McapLog | None":
    if session.log is None and session.feed is None:
        return None
    from footfall.deploy.log import McapLog

    facts = {"policy_spec": policy.name, **session.facts, "joint_rate_hz": session.config.joint_rate_hz}
    if session.others:
        facts |= {OTHERS: list(session.others), HANDOVER: unstructure(session.config.handover)}
    if session.get_up is not None:
        facts[GET_UP] = session.get_up.spec or session.get_up.policy.name
    log = McapLog(session.log, robot, policy, facts, not session.realtime, session.feed, session.log_store)
    resources.callback(log.close)
    return log


def _begin(log: "McapLog | None", start_ns: int, refused: list[str]) -> None:
    if log is not None:
        log.begin(start_ns)
        for note in refused:
            log.note(0, note)


def _end(log: "McapLog", runner: PolicyRunner, now_us: int, notes: list[str]) -> str:
    """Close the log after adding remaining notes; returns what is missing in it."""
    runner.log_orders_and_notes(now_us, log)
    for note in notes:
        log.note(now_us, note)
    return log.close()


def _motors_left_on(loop: ControlLoop) -> list[str]:
    notes = (
        ("no reply to the command to disable from {}", loop.last_resort.silent_at_the_end),
        (
            "still enabled at the end, despite the command to disable: {}. Cut the motors' power",
            loop.last_resort.on_at_the_end,
        ),
    )
    return [note.format(", ".join(motors)) for note, motors in notes if motors]


def _damaged(loop: ControlLoop) -> list[str]:
    count = loop.imu_damaged
    return [f"{count} of the IMU's messages had a wrong checksum and were ignored"] if count else []


def _estimate(
    robot: Robot, policies: Sequence[Policy], config: DeployConfig, base_state: BaseStateFunction | None
) -> BaseEstimate:
    """Create the base estimate if a policy, the command source or the log needs one."""
    needed = config.odometry or any(policy.needs_estimate for policy in policies)
    if base_state is not None or not needed:
        return BaseEstimate(config.estimator_rate_hz, base_state=base_state)
    from footfall.deploy.estimation.estimator import BaseEstimator

    return BaseEstimate(config.estimator_rate_hz, BaseEstimator(robot, config.estimator))
