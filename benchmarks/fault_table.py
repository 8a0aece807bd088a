"""Puts robots through every kind of fault in `benchmarks/fault_kinds`, and counts false alarms without any.

    python benchmarks/fault_table.py --seeds 100 --nominal 1000 --randomised 1000 --out faults.jsonl
    python benchmarks/fault_table.py --read faults.jsonl --json docs/faults.json

Runs are kept in the file as they end, and not run again by a second call.

Lockstep, over the simulated bus. The simulator's own eye on falls is only an observer here, since no real
robot has one: a run ends when the robot damps itself, or a while after the fault.
"""

import argparse
import json
import math
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fault_kinds import KINDS
from fault_kinds.kind import FaultKind
from resumable_runs import read_runs, run_resumable

from footfall.common.rotations import tilt
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import DAMPED, DECIDING, MOVING, Mode
from footfall.deploy.session import Session, run_session
from footfall.deploy.wiring import wire
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.plant.audit import Audit
from footfall.plant.bus import SimulatedBus
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.injection import FaultInjector, InjectingBus, InjectingCommandSource, InjectingPolicy
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.policies.policy import Policy
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot

SUBJECTS = {  # robot and policy, and whether all rows are tried or the main ones
    ("go1", "go1-flat"): True,
    ("go1", "mpc"): True,
    ("hexapod", "hexapod-flat"): False,
    ("hexapod", "tripod"): False,
    ("g1", "g1-flat"): False,
    ("g1", "step"): False,
}
NOISE = Noise(joint_position=0.002, joint_velocity=0.1, gyro=0.02, gravity=0.005)
STAND_S, DAMPING_S = 0.8, 0.1
SAFE = (*DAMPED, Mode.LOWERING)
BETWEEN_S = (0.5, 1.0)  # of walking, when the fault comes
LOOK_S = 0.01  # between two looks at whether the robot is down
TIPPED_RAD = 0.6  # tilt of a robot that has fallen while it lay or stood up
DOWN_S = 0.2  # that it is down, to count as fallen
ROUNDING = 0.04  # of a motor's peak torque: what a frame's quanta may add to a command of the smallest motors
EPISODE_S = 6.0  # of each run without a fault
FALL_S = 1.0  # that a robot takes at most to lie on the ground once it cannot be held any more
PUSH_M_S = 0.6


@dataclass(frozen=True)
class Run:
    """One run with a fault."""

    robot: str
    policy: str
    kind: str
    seed: int
    detected: bool
    seconds: float | None  # from the fault to damping, or to the beginning of lying down
    fault: str  # what the supervisor said
    final_state: str
    fell: bool  # before that
    torque_over: float
    outside_rad: float
    rate_share: float
    stiff: bool  # whether any motor got stiffness


@lru_cache(maxsize=4)
def _robot(name: str) -> Robot:
    return load_robot(name)


def policy_of(robot: str, name: str) -> Policy:
    """Anew for each run: what one has learned of its robot shall not be there in the next."""
    return load_policy(name, _robot(robot))


def kind_of(name: str) -> FaultKind:
    return next(kind for kind in KINDS if title_of(kind) == name)


def title_of(kind: FaultKind) -> str:
    return f"{kind.name} ({kind.group})" if kind.starting else kind.name


class _Watch:
    """Injects the fault at its time, and sees what follows."""

    def __init__(self, injector: FaultInjector, kind: FaultKind, audit: Audit) -> None:
        self._injector, self._kind, self._audit = injector, kind, audit
        self._at_s = math.inf if kind.starting else float(injector.rng.uniform(*BETWEEN_S))
        self.loop: ControlLoop | None = None
        self.injected_us: int | None = 0 if kind.starting else None
        self.safe_us: int | None = None  # damped, or on its way to lie down
        self.fell = False
        self._look_us, self._down_s = 0, 0.0
        injector.bus.watch = self._audit_frames

    def _down(self, mode: Mode) -> bool:
        """Whether the robot has fallen; one that lies before it stands up has not."""
        body = self._injector.body
        if self._kind.lying and mode not in DECIDING:
            return bool(tilt(body.truth().base_quaternion) > TIPPED_RAD)
        return body.fall() is not None

    def _audit_frames(self, frames: Any) -> None:
        if self.loop is not None:
            sensed = self.loop.sensed
            self._audit.look(frames, sensed.joint_position, sensed.joint_velocity)

    def tick(self, loop: ControlLoop) -> None:
        self.loop = loop
        mode, now_us = loop.state.mode, loop.now_us
        if self.injected_us is None:
            if mode is Mode.WALKING and loop.walking_s >= self._at_s:
                self._kind.inject(self._injector)
                self.injected_us = now_us
            return
        if mode in SAFE:
            if self.safe_us is None:
                self.safe_us = now_us
            return
        if mode in (Mode.CHECKING, *MOVING) and now_us >= self._look_us:
            self._look_us = now_us + round(LOOK_S * 1e6)
            self._down_s = self._down_s + LOOK_S if self._down(mode) else 0.0
            self.fell = self.fell or self._down_s >= DOWN_S
        if self._kind.wiring and mode not in DECIDING:
            return
        began_us = self.injected_us if not self._kind.starting else round(1.5e6)
        if now_us - began_us >= self._kind.observed_s * 1e6:
            loop.finish()


def run_fault(task: tuple[str, str, str, int]) -> dict[str, Any]:
    """One run with a fault."""
    robot_name, policy_name, title, seed = task
    robot, kind = _robot(robot_name), kind_of(title)
    rng = draws_of(seed, title)
    config = config_of(robot)
    wiring = wire(robot)
    wires = SimulatedWires(wiring.buses, config.host_queue)
    lying = kind.lying and robot.lying_pose is not None
    plant = PlantConfig(noise=NOISE, motor_timeout_s=config.motor_timeout_s, lying=lying)
    body = SimulatedRobot(robot, wiring, wires, plant, seed)
    bus = InjectingBus(SimulatedBus(wires, body))
    policy = InjectingPolicy(policy_of(robot_name, policy_name))
    command = InjectingCommandSource(_drawn_command(rng))
    injector = FaultInjector(robot, wiring, body, bus, policy, command, rng)
    audit = Audit(robot, wiring, config.tick_us * 1e-6)
    watch = _Watch(injector, kind, audit)
    if kind.starting:
        kind.inject(injector)
    session = Session(
        command_source=command, duration_s=20.0, realtime=False, config=config, check_wiring=kind.wiring
    )
    outcome = run_session(robot, policy, bus, session, watch.tick)
    if watch.safe_us is None and outcome.faults:  # in the very last tick
        watch.safe_us = round(outcome.run_s * 1e6)
    detected = bool(outcome.faults) and watch.safe_us is not None and watch.injected_us is not None
    run = Run(
        robot=robot_name,
        policy=policy_name,
        kind=title,
        seed=seed,
        detected=detected,
        seconds=(watch.safe_us - watch.injected_us) * 1e-6 if detected else None,  # type: ignore[operator]
        fault=outcome.faults[0] if outcome.faults else "",
        final_state=outcome.final_state,
        fell=watch.fell,
        torque_over=audit.torque_over,
        outside_rad=audit.outside_rad,
        rate_share=audit.rate_share,
        stiff=audit.stiff,
    )
    return asdict(run)


def draws_of(seed: int, title: str) -> np.random.Generator:
    """Random numbers of a run: those of its kind, whatever other kinds there are."""
    return np.random.default_rng([seed, zlib.crc32(title.encode())])


def _checks_wiring(robot: str, policy: str, lying: bool) -> bool:
    """Whether wiring is tried: it is over before a policy decides, so one policy of each robot will do."""
    first = next(name for of, name in SUBJECTS if of == robot)
    return policy == first and not (lying and _robot(robot).lying_pose is None)


def config_of(robot: Robot) -> DeployConfig:
    """The robot's own limits; it stands up and is damped quickly, since many runs wait."""
    own = deploy_config(robot)
    return replace(own, stand_s=STAND_S, safety=replace(own.safety, damping_s=DAMPING_S))


def _drawn_command(rng: np.random.Generator) -> np.ndarray:
    return np.array([rng.uniform(0.2, 0.6), rng.uniform(-0.2, 0.2), rng.uniform(-0.5, 0.5)])


# -- without a fault -----------------------------------------------------------------------------------


def run_healthy(task: tuple[str, str, bool, int]) -> dict[str, Any]:
    """One run of a healthy robot that is pushed: what its supervisor said, if anything.

    Whatever it said is a false alarm unless the robot was falling. The same run tells by limits that no fall
    reaches: it goes the same way until then, and within `FALL_S` the simulator sees the robot down, or not.
    """
    robot, policy, randomised, seed = task
    config = deploy_config(_robot(robot))
    walk = _walk(task, config)
    fell_s = walk.fell_s
    if walk.fault and fell_s is None:
        fell_s = _walk(task, _beyond_falls(config)).fell_s
    down = fell_s is not None and (walk.fault_s is None or fell_s <= walk.fault_s + FALL_S)
    return {
        "robot": robot,
        "policy": policy,
        "randomised": randomised,
        "seed": seed,
        "fell": down,
        "fell_s": fell_s,
        "alarm": "" if down else walk.fault,
        "fault": walk.fault,
        "fault_s": walk.fault_s,
    }


def _beyond_falls(config: DeployConfig) -> DeployConfig:
    """The same limits, but for those that a falling robot goes beyond: it lies on the ground then."""
    sensors = replace(config.safety.sensors, sunk=1.0, rotation_rad=math.pi, lean_error=2.0, lift_error=2.0)
    return replace(config, safety=replace(config.safety, tilt_limit_rad=math.pi / 2, sensors=sensors))


class Walk(NamedTuple):
    """How a healthy robot's walk ended. Times are of walking, s."""

    fault: str  # what the supervisor said; empty if nothing
    fault_s: float | None
    fell_s: float | None  # when the simulator saw it down; None if a fault came first


def _walk(task: tuple[str, str, bool, int], config: DeployConfig) -> Walk:
    robot_name, policy_name, randomised, seed = task
    robot = _robot(robot_name)
    rng = np.random.default_rng([seed, int(randomised)])
    sample = None
    if randomised:
        bodies = SimulatedRobot(robot, wire(robot), SimulatedWires(wire(robot).buses)).model.nbody - 1
        sample = draw(
            randomisation_of(robot), lambda count: rng.uniform(size=count), len(robot.joint_names), bodies
        )
    schedule = [_drawn_command(rng) for _ in range(3)]
    pushes = tuple(_drawn_push(rng, at_s) for at_s in (1.5, 4.0))
    episode = Episode(
        command_source=lambda t: schedule[min(int(t / 2.0), 2)],
        duration_s=EPISODE_S,
        seed=seed,
        sample=sample,
        noise=NOISE,
        pushes=pushes,
        record=False,
        config=config,
    )
    trace = run_episode(robot, policy_of(robot_name, policy_name), episode)
    fault = trace.faults[0] if trace.faults else ""
    seen = trace.fell and trace.fall_reason != fault  # by the simulator, not by the supervisor
    return Walk(fault, trace.walked_s if fault else None, trace.walked_s if seen else None)


def _drawn_push(rng: np.random.Generator, at_s: float) -> Push:
    angle, size = rng.uniform(0.0, math.tau), rng.uniform(0.0, PUSH_M_S)
    return Push(at_s + rng.uniform(0.0, 0.7), (size * math.cos(angle), size * math.sin(angle), 0.0))


# -- tables --------------------------------------------------------------------------------------------


def rows(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """A row for each robot, policy and kind of fault, in the order of the table of kinds."""
    found = []
    for (robot, policy), _ in SUBJECTS.items():
        for kind in KINDS:
            of = [r for r in runs if (r["robot"], r["policy"], r["kind"]) == (robot, policy, title_of(kind))]
            if of:
                found.append(_row(robot, policy, kind, of))
    return found


def _row(robot: str, policy: str, kind: FaultKind, runs: list[dict[str, Any]]) -> dict[str, Any]:
    seconds = [run["seconds"] for run in runs if run["seconds"] is not None]
    in_time = sum(s <= (kind.within_s or math.inf) + 1e-9 for s in seconds)
    detected = sum(run["detected"] for run in runs)
    worst = {name: max(run[name] for run in runs) for name in ("torque_over", "outside_rad", "rate_share")}
    within_limits = (
        worst["torque_over"] <= ROUNDING and worst["outside_rad"] <= 1e-3 and worst["rate_share"] <= 1.01
    )
    idle = sum(run["fell"] and run["final_state"] == Mode.IDLE.value for run in runs)
    expected = kind.within_s is None or in_time >= 0.99 * len(runs)
    return {
        "robot": robot,
        "policy": policy,
        "kind": title_of(kind),
        "group": kind.group,
        "runs": len(runs),
        "detected": detected,
        "in_time": in_time,
        "limit_s": kind.within_s,
        "median_s": float(np.median(seconds)) if seconds else None,
        "longest_s": max(seconds, default=None),
        **worst,
        "stiff": sum(run["stiff"] for run in runs),
        "final_states": dict(Counter(run["final_state"] for run in runs)),
        "fell": sum(run["fell"] for run in runs),
        "idle_after_a_fall": idle,
        "reason": kind.reason,
        "faults": dict(Counter(_without_figures(run["fault"]) for run in runs).most_common(3)),
        "as_expected": expected and within_limits and not idle,
    }


def _without_figures(fault: str) -> str:
    return re.sub(r"^.*\(can\d+, id \d+\): ", "", re.sub(r"-?\d+\.\d+|\d+(?=%)", "…", fault))


def table(found: Sequence[dict[str, Any]], healthy: Sequence[dict[str, Any]]) -> str:
    """Content of docs/faults.json: rows of faults, and counts of runs without one; a row a line."""
    parts = {"healthy": _healthy_rows(healthy), "rows": [_published(row) for row in found]}
    blocks = [
        f'"{name}": [\n' + ",\n".join(json.dumps(row, ensure_ascii=False) for row in of) + "\n]"
        for name, of in parts.items()
    ]
    return "{\n" + ",\n".join(blocks) + "\n}\n"


def _healthy_rows(runs: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    rows = []
    for robot, policy in SUBJECTS:
        for randomised in (False, True):
            of = [
                r for r in runs if (r["robot"], r["policy"], r["randomised"]) == (robot, policy, randomised)
            ]
            if of:
                rows.append(
                    {
                        "policy": policy,
                        "robot": robot,
                        "plant": "randomised" if randomised else "nominal",
                        "runs": len(of),
                        "false_alarms": sum(bool(run["alarm"]) for run in of),
                        "fell": sum(run["fell"] for run in of),
                    }
                )
    return rows


def _published(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "policy": row["policy"],
        "robot": row["robot"],
        "group": row["group"],
        "fault": row["kind"].removesuffix(f" ({row['group']})"),
        "noticed": row["detected"],
        "runs": row["runs"],
        "median_ms": _ms(row["median_s"]),
        "longest_ms": _ms(row["longest_s"]),
        "limit_ms": _ms(row["limit_s"]),
        "commands": _worst(row),
        "ends": dict(sorted(row["final_states"].items())),
        "fell_first": row["fell"],
        "as_expected": row["as_expected"],
        "reason": row["reason"] if row["as_expected"] else row["reason"] or "missed",
    }


def _ms(seconds: float | None) -> int | None:
    return None if seconds is None else round(1e3 * seconds)


def _worst(row: dict[str, Any]) -> str:
    """What went beyond a limit, if anything."""
    if row["group"] == "at the start" and not row["stiff"]:
        return "no stiffness"
    over = []
    if row["torque_over"] > ROUNDING:
        over.append(f"torque over by {row['torque_over']:.0%} of the peak")
    if row["outside_rad"] > 1e-3:
        over.append(f"target {row['outside_rad']:.2f} rad outside")
    if row["rate_share"] > 1.01:
        over.append(f"target at {row['rate_share']:.1f} times its rate")
    return ", ".join(over) or "within"


# -- command line --------------------------------------------------------------------------------------


def measure(options: argparse.Namespace) -> tuple[list[dict[str, Any]], list[dict[str, Any]], list[str]]:
    """Run everything that was asked for: runs with a fault, runs without, and what went wrong."""
    chosen = [pair for pair in SUBJECTS if options.policy in (None, pair[1])]
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    faults = [
        (robot, policy, title_of(kind), seed)
        for seed in seeds  # first, so that a run that is stopped has some of each kind
        for robot, policy in chosen
        for kind in KINDS
        if (SUBJECTS[robot, policy] or kind.main) and (options.only or "") in title_of(kind)
        if options.group in (None, kind.group)
        if not kind.wiring or _checks_wiring(robot, policy, kind.lying)
        if not kind.estimating or policy_of(robot, policy).needs_estimate
    ]
    healthy = [
        (robot, policy, randomised, seed)
        for seed in range(max(options.nominal, options.randomised))
        for robot, policy in chosen
        for randomised, count in ((False, options.nominal), (True, options.randomised))
        if seed < (count if SUBJECTS[robot, policy] else count // 10)
    ]
    kept = (options.out, options.workers, options.time_limit)
    runs, errors = run_resumable(run_fault, faults, *kept)
    walks, more = run_resumable(run_healthy, healthy, *kept)
    return runs, walks, [*errors, *more]


def read(path: Path) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Runs with a fault and runs without in a file."""
    runs = list(read_runs(path).values())
    return [run for run in runs if "kind" in run], [run for run in runs if "kind" not in run]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument(
        "--first-seed", type=int, default=0, help="where several machines share the seeds of faults"
    )
    parser.add_argument("--workers", type=int)
    parser.add_argument(
        "--nominal", type=int, default=0, help="runs without a fault; a tenth where rows are few"
    )
    parser.add_argument("--randomised", type=int, default=0, help="the same on randomised robots")
    parser.add_argument("--policy", help="this policy alone")
    parser.add_argument("--only", help="kinds with this in their names alone")
    parser.add_argument("--group", help="kinds of this group alone, such as wiring")
    parser.add_argument("--out", type=Path, help="file that keeps every run; those in it are not run again")
    parser.add_argument(
        "--time-limit", type=float, help="seconds until no run begins, for each of both parts"
    )
    parser.add_argument("--read", type=Path, help="runs to make the table of, instead of running")
    parser.add_argument("--json", type=Path, help="write the table's rows to this file")
    options = parser.parse_args()

    runs, healthy, errors = (*read(options.read), []) if options.read else measure(options)
    found = rows(runs)
    if options.json:
        options.json.write_text(table(found, healthy), encoding="utf-8")
    wrong = [row for row in found if not row["as_expected"]]
    alarms = [run for run in healthy if run["alarm"]]
    print(f"{len(found)} rows, {len(wrong)} not as expected; {len(alarms)} false alarms")
    for row in wrong:
        print(f"  {row['policy']}: {row['kind']}: in time {row['in_time']}/{row['runs']}, {row['faults']}")
    for text in [*(f"  alarm: {run}" for run in alarms), *errors]:
        print(text)


if __name__ == "__main__":
    main()
