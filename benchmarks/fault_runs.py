"""One run of a simulated robot into which a fault is injected, and how its supervisor responds.

Called by `fault_table.py`.
"""

import math
import zlib
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from fault_kinds import KINDS
from fault_kinds.kind import FaultKind
from fault_subjects import (
    GET_UP,
    NOISE,
    PUSHED_OVER_M_S,
    FaultTask,
    drawn_command,
    ground_of,
    policy_of,
    powered,
    robot_of,
    scanner_of,
)

from footfall.common.rotations import tilt
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import DAMPED, DECIDING, MOVING, Mode
from footfall.deploy.recovery import GetUp
from footfall.deploy.recovery_config import RecoveryConfig
from footfall.deploy.session import Session, run_session
from footfall.deploy.wiring import wiring_of
from footfall.plant.audit import Audit
from footfall.plant.bus import SimulatedBus
from footfall.plant.injection import FaultInjector, InjectingBus, InjectingCommandSource, InjectingPolicy
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.robots.description import Robot

STAND_S, DAMPING_S = 0.8, 0.1
CHARGE, LOW_CHARGE = 0.7, 0.35  # initial charge of a battery, and of one that runs empty, shares
SAFE = (*DAMPED, Mode.LOWERING)
BETWEEN_S = (0.5, 1.0)  # time in walking at which the fault comes, or the push that makes the robot fall
UNFOLDED_S = RecoveryConfig().unfold_s  # time in getting up from which the get-up policy decides
UP_BETWEEN_S = (0.1, 0.6)  # time in getting up at which the fault comes
FALL_CHECK_S = 0.01  # period of the check whether the robot is down
TIPPED_RAD = 0.6  # tilt of a robot that has fallen while it lay or stood up
DOWN_S = 0.2  # a robot that is down for this long counts as fallen
GET_UP_TIMEOUT_S = 60.0  # limit of a run in which the robot gets up


@dataclass(frozen=True)
class Run:
    """One run with a fault."""

    robot: str
    policy: str
    ground: str
    kind: str
    seed: int
    detected: bool
    seconds: float | None  # time from the fault to damping, or to the beginning of lying down
    fault: str  # the supervisor's message
    final_state: str
    fell: bool  # whether the robot fell before the supervisor's fault
    torque_over: float
    outside_rad: float
    rate_share: float
    stiff: bool  # whether any motor got stiffness
    stiff_when_damped: bool  # whether any motor got stiffness while the loop damped the robot
    came: bool  # whether the fault was injected; it is not if the push did not make the robot fall


def kind_of(name: str) -> FaultKind:
    return next(kind for kind in KINDS if title_of(kind) == name)


def title_of(kind: FaultKind) -> str:
    return f"{kind.name} ({kind.group})" if kind.starting else kind.name


class Watch:
    """Injects the fault at its time, and records how the robot responds."""

    def __init__(self, injector: FaultInjector, kind: FaultKind, audit: Audit, damped: Audit) -> None:
        rng = injector.rng
        self._injector, self._kind, self._audit, self._damped = injector, kind, audit, damped
        self._at_s = math.inf if kind.starting else float(rng.uniform(*BETWEEN_S))
        self._up_s = float(rng.uniform(*UP_BETWEEN_S)) if kind.getting_up else 0.0
        self._pushed = False
        self.ended = False  # whether the observed time after the fault is over
        self.loop: ControlLoop | None = None
        self.injected_us: int | None = 0 if kind.starting else None
        self.safe_us: int | None = None  # time at which the robot was damped, or began to lie down
        self.fault = ""  # the supervisor's message at that time
        self.fell = False
        self._next_check_us, self._down_s = 0, 0.0
        injector.bus.watch = self._audit_frames

    def _has_fallen(self, mode: Mode) -> bool:
        """Whether the robot has fallen. A robot that lies before it stands up has not."""
        body = self._injector.body
        if self._kind.lying and mode not in DECIDING:
            return bool(tilt(body.truth().base_quaternion) > TIPPED_RAD)
        return body.fall() is not None

    def _audit_frames(self, frames: Any) -> None:
        if self.loop is None:
            return
        sensed = self.loop.sensed
        audits = (self._audit, self._damped) if self.loop.state.mode in DAMPED else (self._audit,)
        for audit in audits:
            audit.update(frames, sensed.joint_position, sensed.joint_velocity)

    def _due(self, loop: ControlLoop) -> bool:
        """Whether the time for the fault has come.

        For faults while getting up, the robot is pushed over first.
        """
        mode = loop.state.mode
        if not self._kind.getting_up:
            return mode is Mode.WALKING and loop.walking_s >= self._at_s
        if mode is Mode.WALKING and loop.walking_s >= self._at_s and not self._pushed:
            self._pushed = True
            angle = self._injector.rng.uniform(0.0, math.tau)
            x, y = PUSHED_OVER_M_S * math.cos(angle), PUSHED_OVER_M_S * math.sin(angle)
            self._injector.body.push((x, y, 1.0))
        return mode is Mode.RECOVERING and loop.now_us * 1e-6 - loop.state.since_s >= UNFOLDED_S + self._up_s

    def tick(self, loop: ControlLoop) -> None:
        self.loop = loop
        mode, now_us = loop.state.mode, loop.now_us
        if self.injected_us is None:
            if self._due(loop):
                self._kind.inject(self._injector)
                self.injected_us = now_us
            return
        if mode in SAFE:
            if self.safe_us is None and not self.ended:
                self.safe_us, self.fault = now_us, loop.state.faults[-1] if loop.state.faults else ""
            return
        if mode in (Mode.CHECKING, *MOVING) and now_us >= self._next_check_us:
            self._next_check_us = now_us + round(FALL_CHECK_S * 1e6)
            self._down_s = self._down_s + FALL_CHECK_S if self._has_fallen(mode) else 0.0
            self.fell = self.fell or self._down_s >= DOWN_S
        if self._kind.wiring and mode not in DECIDING:
            return
        began_us = self.injected_us if not self._kind.starting else round(1.5e6)
        if now_us - began_us >= self._kind.observed_s * 1e6:
            self.ended = True
            loop.finish()


def run_fault(task: FaultTask) -> dict[str, Any]:
    """One run with a fault."""
    task = FaultTask(*task)
    kind = kind_of(task.title)
    robot = powered(task.robot) if kind.powered else robot_of(task.robot)
    rng = draws_of(task.seed, task.title)
    config = config_of(robot)
    wiring = wiring_of(robot)
    wires = SimulatedWires(wiring.buses, config.host_queue)
    lying, ground = kind.lying and robot.lying_pose is not None, ground_of(task.subject, task.seed)
    plant = PlantConfig(
        noise=NOISE,
        motor_timeout_s=config.motor_timeout_s,
        lying=lying,
        ground=ground,
        charge=LOW_CHARGE if kind.starting else CHARGE,
    )
    body = SimulatedRobot(robot, wiring, wires, plant, task.seed)
    bus = InjectingBus(SimulatedBus(wires, body))
    policy = faulty = InjectingPolicy(policy_of(task.robot, task.policy))
    if kind.getting_up:
        faulty = InjectingPolicy(policy_of(task.robot, GET_UP[task.robot]))
    command = InjectingCommandSource(drawn_command(rng))
    injector = FaultInjector(robot, wiring, body, bus, faulty, command, rng)
    audit, damped = (Audit(robot, wiring, config.tick_us * 1e-6) for _ in range(2))
    watch = Watch(injector, kind, audit, damped)
    if kind.starting:
        kind.inject(injector)
    session = Session(
        command_source=command,
        duration_s=GET_UP_TIMEOUT_S if kind.getting_up else 20.0,
        realtime=False,
        config=config,
        check_wiring=kind.wiring,
        get_up=GetUp(faulty) if kind.getting_up else None,
        height_scans=scanner_of(policy, body, ground, task.seed),
    )
    outcome = run_session(robot, policy, bus, session, watch.tick)
    if watch.safe_us is None and outcome.faults and not watch.ended:  # in the very last tick
        watch.safe_us, watch.fault = round(outcome.run_s * 1e6), outcome.faults[0]
    detected = bool(watch.fault) and watch.injected_us is not None
    run = Run(
        robot=task.robot,
        policy=task.policy,
        ground=task.ground,
        kind=task.title,
        seed=task.seed,
        detected=detected,
        seconds=(watch.safe_us - watch.injected_us) * 1e-6 if detected else None,  # type: ignore[operator]
        fault=watch.fault,
        final_state=outcome.final_state,
        fell=watch.fell,
        torque_over=audit.torque_over,
        outside_rad=audit.outside_rad,
        rate_share=audit.rate_share,
        stiff=audit.stiff,
        stiff_when_damped=damped.stiff,
        came=watch.injected_us is not None,
    )
    return asdict(run)


def draws_of(seed: int, title: str) -> np.random.Generator:
    """Random generator of a run; it depends only on seed and title."""
    return np.random.default_rng([seed, zlib.crc32(title.encode())])


def config_of(robot: Robot) -> DeployConfig:
    """The robot's own limits; standing up and damping are short, to save time over many runs."""
    config = deploy_config(robot)
    return replace(config, stand_s=STAND_S, safety=replace(config.safety, damping_s=DAMPING_S))
