"""One run of a policy on a robot, simulated by default: what `evaluate` and the command line call."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.bus import Bus
from footfall.deploy.clock import Clock, LockstepClock, WallClock, undisturbed
from footfall.deploy.config import DeployConfig
from footfall.deploy.loop import Command, ControlLoop, Estimator, Log
from footfall.deploy.safety import Mode
from footfall.deploy.wiring import Wiring, wire
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.sample import Sample
from footfall.plant.bus import SimulatedBus
from footfall.plant.energy import Power
from footfall.plant.robot import Difference, SimulatedRobot
from footfall.plant.trace import Recorder, Trace, unknown_truth
from footfall.plant.wires import SimulatedWires
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

SIMULATED, VIRTUAL = "sim", "virtual"
UNKNOWN_POWER = Power(np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class Push:
    """A sudden change of the whole robot's velocity."""

    time_s: float  # since walking began
    delta_v_m_s: tuple[float, float, float]  # world frame


@dataclass(frozen=True)
class Episode:
    """What shall happen in a run. The same episode gives the same trace in lockstep."""

    command: Command  # time since walking began, s, to (3,)
    duration_s: float  # of walking
    seed: int = 0
    plant: Path | None = None  # another MJCF than the robot's own
    sample: Sample | None = None
    noise: Noise | None = None
    pushes: tuple[Push, ...] = ()
    ground_truth: bool = False  # hand the policy the true base velocity and height
    realtime: bool = False  # a bus other than the simulated one is always in real time
    log: Path | None = None
    policy_spec: str = ""  # what the user calls the policy; the log keeps it, so that a replay can load it
    bus: str = SIMULATED
    record_rate_hz: float = 100.0
    config: DeployConfig = field(default_factory=DeployConfig)


def run_episode(
    robot: Robot,
    policy: Policy,
    episode: Episode,
    watch: Callable[[ControlLoop, SimulatedRobot | None], None] | None = None,
) -> Trace:
    """Stand up, walk for the episode's duration, damp, switch off.

    Args:
        robot: what the controller believes that it moves.
        policy: its mind.
        episode: what shall happen.
        watch: called after each joint tick with the loop and the simulated robot, to observe or to inject
            faults.

    Raises:
        UserError: plant, policy, bus or log do not fit; nothing has moved then.
    """
    if not episode.duration_s > 0.0:
        raise UserError(f"duration is {episode.duration_s:g} s: it must be above 0")
    _check_contract(policy, robot)
    wiring, config = wire(robot), episode.config
    estimated = policy.needs_estimate and not episode.ground_truth
    with ExitStack() as resources:
        bus, body = _open_bus(robot, wiring, episode, resources)
        realtime = episode.realtime or body is None
        clock: Clock = WallClock(config.tick_us) if realtime else LockstepClock(config.tick_us)
        estimator = _estimator(robot) if estimated else None
        loop = ControlLoop(robot, policy, wiring, bus, clock, config, episode.command, estimator)
        if episode.ground_truth:
            loop.truth = _true_base(body)
        loop.log = _open_log(robot, policy, episode, realtime, resources)  # last: nothing else can fail
        run = _Run(robot, loop, body, episode)
        started = time.perf_counter()
        if realtime:
            resources.enter_context(_ending_on_signals(loop))
        with undisturbed(config.realtime_priority if realtime else None):
            try:
                run.drive(watch)
            finally:
                loop.shut_down()
        return run.trace(bus, time.perf_counter() - started)


class _Run:
    """Drives a loop through an episode: pushes, samples, the end."""

    def __init__(
        self, robot: Robot, loop: ControlLoop, body: SimulatedRobot | None, episode: Episode
    ) -> None:
        self._loop, self._body, self._episode = loop, body, episode
        self._joints, self._feet = len(robot.joint_names), len(robot.description.feet)
        self._recorder = Recorder(self._joints, self._feet)
        self._pushes = sorted(episode.pushes, key=lambda push: push.time_s)
        self._record_every_s = 1.0 / episode.record_rate_hz
        self._next_record_s = 0.0
        self._fall_reason = ""
        self._diverged = False

    def drive(self, watch: Callable[[ControlLoop, SimulatedRobot | None], None] | None) -> None:
        loop, body = self._loop, self._body
        while loop.tick():
            if loop.state.mode is Mode.WALKING:
                self._walk()
            if watch is not None:
                watch(loop, body)

    def _walk(self) -> None:
        loop, body = self._loop, self._body
        now_s = loop.walking_s
        while body is not None and self._pushes and self._pushes[0].time_s <= now_s:
            body.push(self._pushes.pop(0).delta_v_m_s)
        if now_s >= self._next_record_s - 1e-9:
            self._record(now_s)
            self._next_record_s += self._record_every_s
            if body is not None and (reason := body.fall()) is not None:
                self._fall_reason = reason
                loop.finish()
            if body is not None and body.diverged():
                self._diverged = True
                loop.finish()
        if now_s >= self._episode.duration_s - 1e-9:
            loop.finish()

    def _record(self, now_s: float) -> None:
        loop, body = self._loop, self._body
        truth = unknown_truth(self._joints, self._feet) if body is None else body.truth()
        power = UNKNOWN_POWER if body is None else body.take_power()
        velocity, height = loop.estimate
        observation = loop.observation
        self._recorder.add(
            **truth._asdict(),
            time_s=now_s,
            command=np.zeros(3) if observation is None else observation.command,
            joint_target=loop.target,
            estimated_velocity=velocity,
            estimated_height=height,
            electrical_power=power.electrical,
            mechanical_power=power.mechanical,
            positive_power=power.positive,
        )

    def trace(self, bus: Bus, wall_s: float) -> Trace:
        loop, body = self._loop, self._body
        state = loop.state
        tipped = state.mode is Mode.FALLING
        faults = state.faults
        if self._diverged:
            faults = (*faults, "the simulation diverged")
        return Trace(
            **self._recorder.arrays(),
            compute_ms=np.array(loop.timing.policy_ms),
            record_rate_hz=self._episode.record_rate_hz,
            faults=faults,
            final_state=Mode.FALLING.value if self._fall_reason else state.mode.value,
            fell=bool(self._fall_reason) or tipped or self._diverged,
            fall_reason=self._fall_reason or (faults[0] if tipped else ""),
            timing=loop.timing.summary(),
            buses=tuple(bus.statistics()),
            wall_s=wall_s,
            simulated_s=loop.now_us * 1e-6,
            notes=() if body is None else body.notes,
        )


def _check_contract(policy: Policy, robot: Robot) -> None:
    differences = [] if policy.contract is None else policy.contract.mismatches(robot)
    if differences:
        raise UserError(f"policy '{policy.name}' does not fit robot '{robot.name}': {'; '.join(differences)}")


def _open_bus(
    robot: Robot, wiring: Wiring, episode: Episode, resources: ExitStack
) -> tuple[Bus, SimulatedRobot | None]:
    """The bus, and the simulated robot if it lives in this loop's time."""
    difference = Difference(
        episode.plant, episode.sample or Sample(), episode.noise, episode.config.motor_timeout_s
    )
    if episode.bus == SIMULATED:
        wires = SimulatedWires(wiring.buses, episode.config.host_queue)
        body = SimulatedRobot(robot, wiring, wires, difference, episode.seed)
        return SimulatedBus(wires, body), body
    from footfall.deploy.python_can_bus import PythonCanBus

    if episode.bus == VIRTUAL:  # reaches no further than this process, so the robot has to live in it
        from footfall.plant.serve import serving

        resources.enter_context(serving(robot, VIRTUAL, difference, episode.seed))
    elif episode.plant is not None or episode.pushes:
        raise UserError(f"bus '{episode.bus}' leads to a robot of its own: no --plant and no pushes there")
    bus = PythonCanBus(episode.bus, wiring.buses)
    resources.callback(bus.close)
    return bus, None


def _open_log(
    robot: Robot, policy: Policy, episode: Episode, realtime: bool, resources: ExitStack
) -> Log | None:
    if episode.log is None:
        return None
    from footfall.deploy.log import McapLog

    facts = {
        "seed": episode.seed,
        "policy_spec": episode.policy_spec or policy.name,
        "bus": episode.bus,
        "plant": None if episode.plant is None else str(episode.plant),
        "joint_rate_hz": episode.config.joint_rate_hz,
    }
    start_ns = time.time_ns() if realtime else 0
    every_us = round(1e6 / episode.config.log_rate_hz)
    log = McapLog(episode.log, robot, policy, every_us, facts, start_ns)
    resources.callback(log.close)
    return log


@contextmanager
def _ending_on_signals(loop: ControlLoop) -> Iterator[None]:
    """Ctrl-C and a polite kill end the run in an orderly way: damping, then motors off."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {
        number: signal.signal(number, lambda *_: loop.finish()) for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _estimator(robot: Robot) -> Estimator:
    from footfall.deploy.estimator import BaseEstimator

    return BaseEstimator(robot)


def _true_base(body: SimulatedRobot | None) -> Callable[[], tuple[np.ndarray, float]]:
    if body is None:
        raise UserError("--ground-truth needs the simulated robot: leave --bus at 'sim'")

    def read() -> tuple[np.ndarray, float]:
        truth = body.truth()
        stance = truth.foot_position[truth.foot_contact, 2]
        ground = float(stance.mean()) if len(stance) else 0.0
        return truth.base_velocity, float(truth.base_position[2]) - ground

    return read
