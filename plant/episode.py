"""A simulated episode: a session on the simulated robot, with pushes, ground truth and fall detection."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from footfall.common.config import require_between, require_not_negative, require_positive
from footfall.common.engines import DEFAULT_ENGINE
from footfall.deploy.command_source import CommandSource, StopSource, VelocityFunction
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.height_scan import HeightScanSource
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.recovery import GetUp
from footfall.deploy.session import BaseStateFunction, Session, SessionResult, run_session
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.height_scan import HeightScanErrors
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.sample import Sample
from footfall.plant.bus import SimulatedBus
from footfall.plant.ground_truth import Snapshot
from footfall.plant.height_scan import SimulatedScanner
from footfall.plant.progress import Progress
from footfall.plant.recorder import Recorder, TraceSample
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.trace import Trace
from footfall.plant.wires import SimulatedWires
from footfall.policies.height_scan import common_height_scan
from footfall.policies.policy import Policy
from footfall.robots.description import Robot
from footfall.terrain.ground import Ground

BUS = "sim"  # name of the simulated bus on the command line

Watch = Callable[[ControlLoop, SimulatedRobot], None]
Velocity = Callable[[], np.ndarray]  # of the base in the last sample: m/s, body frame, (3,)


class Display(Protocol):
    """Shows a running episode."""

    def __call__(self, loop: ControlLoop, velocity: Velocity) -> AbstractContextManager[None]: ...


@dataclass(frozen=True)
class Push:
    """A sudden change of the whole robot's velocity. Raises ValueError unless all numbers are finite."""

    time_s: float  # since walking began; skipped if the robot does not walk at that time
    delta_v_m_s: tuple[float, float, float]  # world frame

    def __post_init__(self) -> None:
        require_not_negative(self, "time_s")
        if np.shape(self.delta_v_m_s) != (3,) or not np.isfinite(self.delta_v_m_s).all():
            raise ValueError(f"delta_v_m_s must be three finite numbers, not {self.delta_v_m_s}")


@dataclass(frozen=True)
class Episode:
    """The settings of an episode. In lockstep the same settings give the same trace.

    Raises ValueError if seed, charge or record rate are out of their ranges.
    """

    command_source: CommandSource | VelocityFunction
    duration_s: float  # of walking, at most
    seed: int = 0
    plant: Path | None = None  # another MJCF than the robot's own
    ground: Ground | None = None  # None: the plant's own ground, flat if it has none
    sample: Sample | None = None
    noise: Noise | None = None
    pushes: tuple[Push, ...] = ()  # in any order
    lying: bool = False  # whether the robot lies at the start
    charge: float = 1.0  # initial charge of the battery, if robot.yaml declares one
    lie_down: bool = False  # before the motors switch off, if robot and fault permit it
    ground_truth: bool = False  # give the policy the true base velocity and height
    realtime: bool = False
    log: Path | None = None
    log_frames: bool = False  # record CAN frames in the log, too
    feed: Path | None = None  # socket of the run's feed, see deploy/telemetry/feed.py
    policy_spec: str = ""  # name or path of the policy, kept in the log for a replay
    record: bool = True  # keep samples; without them the trace's arrays are empty
    record_rate_hz: float = 100.0  # of samples, fall checks and power
    config: DeployConfig | None = None  # None: the defaults, with the robot's own limits
    display: Display | None = None
    check_wiring: bool = False  # before the robot stands up and walks
    stop_sources: Sequence[StopSource] = ()  # in addition to the command source
    others: Mapping[str, Policy] = field(default_factory=dict)  # further policies that may take over, by spec
    get_up: GetUp | None = None  # permission to get up; then only the control loop detects falls
    engine: str = DEFAULT_ENGINE  # physics engine, see common/engines.py
    # Errors of the simulated height scans; another source of scans replaces these.
    height_scan_errors: HeightScanErrors = field(default_factory=HeightScanErrors)
    height_scans: HeightScanSource | None = None

    def __post_init__(self) -> None:
        require_not_negative(self, "seed")
        require_between(self, 0.0, 1.0, "charge")
        require_positive(self, "record_rate_hz")


def run_episode(robot: Robot, policy: Policy, episode: Episode, watch: Watch | None = None) -> Trace:
    """Stand up, walk for the episode's duration, lie down if `lie_down`, damp, switch off.

    Args:
        robot: the robot that the controller assumes.
        policy: the policy.
        episode: the settings.
        watch: called after each joint tick with the loop and the simulated robot, to observe or to inject
            faults.

    Raises:
        UserError: plant, policy or log do not fit; nothing has moved yet.
    """
    wiring, config = wiring_of(robot), episode.config or deploy_config(robot)
    wires = SimulatedWires(wiring.buses, config.host_queue)
    plant_config = PlantConfig(
        plant=episode.plant,
        engine=episode.engine,
        ground=episode.ground,
        sample=episode.sample or {},
        noise=episode.noise,
        motor_timeout_s=config.motor_timeout_s,
        lying=episode.lying,
        charge=episode.charge,
        release_after_s=config.held_up_s,
    )
    body = SimulatedRobot(robot, wiring, wires, plant_config, episode.seed)
    facts = {
        "seed": episode.seed,
        "policy_spec": episode.policy_spec or policy.name,
        "bus": BUS,
        "plant": None if episode.plant is None else str(episode.plant),
        "engine": episode.engine,
    }
    trial = Trial(robot, body, episode, watch)
    session = Session(
        command_source=episode.command_source,
        duration_s=episode.duration_s,
        realtime=episode.realtime,
        log=episode.log,
        log_frames=episode.log_frames,
        feed=episode.feed,
        facts=facts,
        config=config,
        lie_down=episode.lie_down,
        check_wiring=episode.check_wiring,
        stop_sources=episode.stop_sources,
        others=episode.others,
        get_up=episode.get_up,
        height_scans=episode.height_scans or _scanner(policy, body, episode),
        display=None if episode.display is None else partial(episode.display, velocity=trial.velocity),
    )
    base_state = true_base_state(body) if episode.ground_truth else None
    outcome = run_session(robot, policy, SimulatedBus(wires, body), session, trial.tick, base_state)
    return trial.trace(outcome)


class Trial:
    """Pushes, samples and fall checks of an episode, at each tick of the control loop."""

    def __init__(self, robot: Robot, body: SimulatedRobot, episode: Episode, watch: Watch | None) -> None:
        self._body, self._episode, self._watch = body, episode, watch
        self._sizes = len(robot.joint_names), len(robot.description.feet), body.model.nq
        self._progress = Progress(episode.record_rate_hz)
        self._recorder = Recorder(body.truths, self._progress, keep=episode.record)
        self._last: Snapshot | None = None  # of the last sample
        self._pushes = sorted(episode.pushes, key=lambda push: push.time_s)
        self._sample_period_s = 1.0 / episode.record_rate_hz
        self._next_sample_s = 0.0
        self._fall_reason = ""
        self._diverged = self._walked = False

    def velocity(self) -> np.ndarray:
        """The base's true velocity in the last sample, m/s, body frame, (3,); NaN before the first one."""
        if self._last is None:
            return np.full(3, np.nan)
        velocity: np.ndarray = self._body.truths([self._last]).base_velocity[0]
        return velocity

    def tick(self, loop: ControlLoop) -> None:
        """Call after each joint tick."""
        walking = loop.state.mode is Mode.WALKING
        self._walked = self._walked or walking
        if self._walked and self._pushes:
            self._push(loop.walking_s, walking)
        if walking:
            self._sample(loop)
        if self._watch is not None:
            self._watch(loop, self._body)

    def _push(self, now_s: float, walking: bool) -> None:
        """Apply the pushes that are due, except to a robot that lies after a fall or gets up."""
        while self._pushes and self._pushes[0].time_s <= now_s:
            push = self._pushes.pop(0)
            if walking:
                self._body.push(push.delta_v_m_s)

    def _sample(self, loop: ControlLoop) -> None:
        body, now_s = self._body, loop.walking_s
        if now_s < self._next_sample_s - 1e-9:
            return
        self._next_sample_s = max(self._next_sample_s + self._sample_period_s, now_s)  # later, after a fall
        self._last = snapshot = body.snapshot()
        estimate = loop.estimate
        self._recorder.add(
            TraceSample(snapshot, body.take_power(), now_s, loop.requested_command, loop.target, *estimate)
        )
        if self._episode.get_up is None and (reason := body.fall(snapshot)) is not None:
            self._fall_reason = reason
            loop.finish(skip_lie_down=True)
        if body.diverged():
            self._diverged = True
            loop.finish(skip_lie_down=True)

    def trace(self, outcome: SessionResult) -> Trace:
        """The episode's trace; a fall that only the simulation detected counts, too."""
        ended_falling = outcome.final_state == Mode.FALLING.value
        report: dict[str, Any] = {**vars(outcome), **self._recorder.arrays(*self._sizes)}
        report["notes"] = (*outcome.notes, *self._body.notes)
        if self._diverged:
            report["faults"] = (*outcome.faults, "the simulation diverged")
        if self._fall_reason:
            report["final_state"] = Mode.FALLING.value
        return Trace(
            **report,
            fell=bool(self._fall_reason) or ended_falling or self._diverged,
            fall_reason=self._fall_reason or (outcome.faults[0] if ended_falling else ""),
            distance_m=self._progress.distance_m,
            mean_velocity=self._progress.mean_velocity,
            record_rate_hz=self._episode.record_rate_hz,
        )


def _scanner(policy: Policy, body: SimulatedRobot, episode: Episode) -> HeightScanSource | None:
    """The simulated robot's height scans, if a policy of the episode reads them."""
    scan = common_height_scan([each.contract for each in (policy, *episode.others.values())])

    def pose() -> tuple[np.ndarray, np.ndarray]:
        truth = body.truth()
        return truth.base_position, truth.base_quaternion

    if scan is None:
        return None
    return SimulatedScanner(scan, episode.height_scan_errors, episode.ground, pose, episode.seed)


def true_base_state(body: SimulatedRobot) -> BaseStateFunction:
    """Reads the true base velocity, and the base's height above the mean standing foot."""

    def read() -> tuple[np.ndarray, float]:
        truth = body.truth()
        stance = truth.foot_position[truth.foot_contact, 2]
        ground = float(stance.mean()) if len(stance) else 0.0
        return truth.base_velocity, float(truth.base_position[2]) - ground

    return read
