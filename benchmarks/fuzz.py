"""Malformed input at every reader: nothing may end in a traceback, or in an unsafe command.

    python benchmarks/fuzz.py [--what logs frames yaml policies] [--count N] [--workers 1] [--out FILE]

`logs`: a run's log with bytes or records changed, to reading, replay and recovery. `frames`: random and
mutated CAN frames to the joint layer, each batch followed by a command that is held against the robot's
limits, and to the motors. `yaml`: settings and descriptions with bytes and values changed, to their readers.
`policies`: ONNX files with bytes and contracts changed.

Cases come in pieces. Each piece's result is a line of --out, and a run that was stopped, or that --time-limit
ended, goes on from there. Prints a JSON object for each kind with counts for each reader (of frames: of
batches); exit status 1 if anything escaped.
"""

import argparse
import json
import shutil
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from kept_runs import run_kept

import footfall.policies
from footfall.common.errors import UserError
from footfall.deploy.config import deploy_config
from footfall.deploy.drivers import imu
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.drivers.driver import Driver
from footfall.deploy.frames import EXTENDED, Frames
from footfall.deploy.joint_layer import JointLayer
from footfall.deploy.log_file import read_log
from footfall.deploy.recover import recover
from footfall.deploy.replay import replay
from footfall.deploy.wiring import Wiring, wire
from footfall.domain_rand.randomisation import DEFAULT as RANDOMISATION
from footfall.domain_rand.randomisation import load_randomisation
from footfall.evaluate.scenarios import DEFAULT as SCENARIOS
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, run_episode
from footfall.plant.motor_ends.choice import open_motor_end
from footfall.plant.motor_ends.motor_end import MotorEnd
from footfall.plant.motors import SimulatedMotors
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.policies.contract import CONTRACT_KEY
from footfall.policies.learned import LearnedPolicy
from footfall.policies.policy import Observation, Sensed
from footfall.policies.registry import load_policy
from footfall.robots.actuator import JointCommand, limit_torque, pd_torque
from footfall.robots.description import Robot, load_robot
from footfall.train.config import PRESETS, load_preset

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from mutate import mutated, mutated_records, mutated_yaml, with_a_change

ROBOT, POLICY = "go1", "go1-flat"
ZOO = Path(footfall.policies.__file__).parent / "zoo"
COUNTS = {"logs": 600, "frames": 10_000_000, "yaml": 2000, "policies": 600}
PIECES = {"logs": 20, "frames": 102_400, "yaml": 60, "policies": 60}  # cases of each
MOST_SHOWN = 20  # tracebacks
BATCH = 64  # frames between two commands
TICK_S = 0.002
LOOP = """
joint_rate_hz: 500
stand_s: 1.0
realtime_priority: 80
estimator_rate_hz: 250
safety: {silence_timeout_s: 0.05, tilt_limit_rad: 1.05, damping_kd: 3.0, sensors: {drift_rad: 0.2}}
"""
MODELS = ("", "DM4310", "RS02", "ODrive")  # of motors; the first is what the robot's are


class Tally:
    """What became of the cases."""

    def __init__(self) -> None:
        self.ends: dict[str, Counter[str]] = {}  # of each reader
        self.escaped: dict[str, str] = {}

    def attempt(self, reader: str, case: int, work: Callable[[], object]) -> None:
        """Let a reader do something that may end well or in a UserError."""
        ends = self.ends.setdefault(reader, Counter())
        try:
            work()
            ends["taken"] += 1
        except UserError:
            ends["refused"] += 1
        except BaseException:
            ends["escaped"] += 1
            self.escaped[f"{reader} {case}"] = traceback.format_exc()[-1500:]


@cache
def a_log() -> bytes:
    """The log of a second's walk."""
    robot = load_robot(ROBOT)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        episode = Episode(
            lambda _: np.array([0.5, 0.0, 0.0]), 1.0, log=path, policy_spec=POLICY, record=False
        )
        run_episode(robot, load_policy(POLICY, robot), episode)
        return path.read_bytes()


def fuzz_logs(seeds: range) -> Tally:
    """Each reader of a log, on one mutated log a seed."""
    tally, policy = Tally(), load_policy(POLICY, load_robot(ROBOT))
    with tempfile.TemporaryDirectory() as folder:
        hurt, whole = Path(folder) / "hurt.mcap", Path(folder) / "whole.mcap"
        for seed in seeds:
            mutation = mutated_records if seed % 2 else mutated
            hurt.write_bytes(mutation(a_log(), np.random.default_rng(seed)))
            tally.attempt("read", seed, lambda: read_log(hurt))
            tally.attempt("replay", seed, lambda: replay(hurt, policy))
            tally.attempt("recover", seed, lambda: recover(hurt, whole))
    return tally


def fuzz_frames(cases: range) -> Tally:
    """Frames to the joint layer and to the motors, for the robot's motors and for each other maker's."""
    tally = Tally()
    for model in MODELS:
        part = range(cases.start // BATCH // len(MODELS), -(-cases.stop // BATCH // len(MODELS)))
        fuzz_motors_of(model, part, tally)
    return tally


def fuzz_motors_of(model: str, batches: range, tally: Tally) -> None:
    """Batches of frames for one kind of motor."""
    robot = load_robot(ROBOT)
    wiring = wire(robot)
    wiring = replace(wiring, models=(model,) * len(wiring.models)) if model else wiring
    driver, end = open_driver(wiring), open_motor_end(wiring)
    joints = JointLayer(robot, driver, wiring.imu_channel, TICK_S)
    joints.begin_at(robot.default_pose)
    motors = SimulatedMotors(end, robot.motor, len(wiring.models), {}, 0.001)
    wires = Wires(wiring, driver, end)
    for batch in batches:
        rng = np.random.default_rng(batch)
        maker = model or "own motors"
        to_host, to_motors = (wires.frames(rng, from_motors) for from_motors in (True, False))
        tally.attempt(f"joint layer, {maker}", batch, partial(command_after, to_host, rng, robot, joints))
        tally.attempt(f"motors, {maker}", batch, partial(move, motors, batch, to_motors))


class Wires:
    """Makes frames: any at all, and good ones with bits flipped."""

    def __init__(self, wiring: Wiring, driver: Driver, end: MotorEnd) -> None:
        n = len(wiring.models)
        commands = [driver.command(np.ones((5, n))), driver.enable(), driver.disable(), driver.ask()]
        replies = [end.reply(slice(None), np.zeros((3, n)), 30, np.zeros(n, np.uint64), np.ones(n, bool))]
        inertial = Frames(
            np.full(3, wiring.imu_channel), np.array(imu.IDS), np.zeros((3, 8), np.uint8), np.full(3, 8)
        )
        self._buses = len(wiring.buses)
        self._good = {True: joined([*replies, inertial]), False: joined(commands)}

    def frames(self, rng: np.random.Generator, from_motors: bool) -> Frames:
        """A batch for one end."""
        good = self._good[from_motors]
        rows = rng.integers(len(good.id), size=BATCH)
        channel, identifier, data, length = (np.array(part[rows]) for part in good[:4])
        any_at_all = rng.random(BATCH) < 0.5
        data[any_at_all] = rng.integers(256, size=(int(any_at_all.sum()), 8), dtype=np.uint8)
        data[~any_at_all] ^= (1 << rng.integers(8, size=(int((~any_at_all).sum()), 8), dtype=np.uint8)) * (
            rng.random((int((~any_at_all).sum()), 8)) < 0.1
        ).astype(np.uint8)
        foreign = rng.random(BATCH) < 0.1
        identifier[foreign] = rng.integers(1 << 11, size=int(foreign.sum()))
        far = rng.random(BATCH) < 0.02
        identifier[far] = rng.integers(1 << 29, size=int(far.sum())) | EXTENDED
        short = rng.random(BATCH) < 0.1
        length[short] = rng.integers(9, size=int(short.sum()))
        data[np.arange(8) >= length[:, None]] = 0
        moved = rng.random(BATCH) < 0.05
        channel[moved] = rng.integers(self._buses, size=int(moved.sum()))
        return Frames(channel, identifier, data, length)


def joined(batches: list[Frames]) -> Frames:
    return Frames(*(np.concatenate(parts) for parts in zip(*(each[:4] for each in batches), strict=True)))


def command_after(frames: Frames, rng: np.random.Generator, robot: Robot, joints: JointLayer) -> None:
    """Let the joint layer take frames in, then command something; raise if that is more than it may be."""
    joints.absorb([frames], int(rng.integers(10**9)))
    before = joints.target.copy()
    wanted = rng.normal(size=(5, len(before))) * 10.0 ** rng.uniform(-2, 3, size=(5, 1))
    joints.command(JointCommand(*wanted))
    lower, upper = robot.soft_limits
    step = robot.description.target_rate_rad_s * TICK_S
    sent = joints.sent
    problems = {
        "not finite": not np.isfinite(sent).all(),
        "outside the soft limits": bool(((sent[0] < lower - 1e-9) | (sent[0] > upper + 1e-9)).any()),
        "a leap": bool((np.abs(sent[0] - before) > step + 1e-9).any()),
    }
    position, velocity, _ = joints.joints
    if np.isfinite(joints.joints).all():
        asked = pd_torque(JointCommand(*sent), position, velocity)
        possible = limit_torque(asked, velocity, robot.motor)
        problems["too much torque"] = bool((np.abs(asked) > np.abs(possible) + 1e-6).any())
    if found := [name for name, there in problems.items() if there]:
        raise AssertionError(f"unsafe command: {', '.join(found)}")


def move(motors: SimulatedMotors, step: int, frames: Frames) -> None:
    """Let motors take frames in and move; raise if their torque is none."""
    n = len(motors.enabled)
    motors.answer(step, frames, np.zeros((3, n)))
    torque = motors.torque(step, np.zeros(n), np.zeros(n))
    if not np.isfinite(torque).all():
        raise AssertionError("torque is not finite")


def fuzz_yaml(seeds: range) -> Tally:
    """Each reader of settings in turn, on one mutated file a seed."""
    tally, robot = Tally(), load_robot(ROBOT)
    with tempfile.TemporaryDirectory() as folder:
        copy, file = Path(folder) / ROBOT, Path(folder) / "hurt.yaml"
        shutil.copytree(robot.folder, copy)
        readers: list[tuple[str, bytes, Path, Callable[[], object]]] = [
            ("robot", (robot.folder / "robot.yaml").read_bytes(), copy / "robot.yaml", lambda: stand(copy)),
            ("loop", LOOP.encode(), file, lambda: deploy_config(load_robot(ROBOT), file)),
            ("randomisation", RANDOMISATION.read_bytes(), file, lambda: load_randomisation(file)),
            ("scenarios", SCENARIOS.read_bytes(), file, lambda: load_scenarios(robot, file)),
            ("preset", (PRESETS / "cpu.yaml").read_bytes(), file, lambda: load_preset(str(file))),
            (
                "controller",
                (robot.folder / "controllers.yaml").read_bytes(),
                copy / "controllers.yaml",
                lambda: [load_policy(name, load_robot(str(copy))) for name in ("trot", "mpc", "stand")],
            ),
        ]
        for seed in seeds:
            name, content, path, read = readers[seed % len(readers)]
            path.write_bytes(mutated_yaml(content, np.random.default_rng(seed)))
            tally.attempt(name, seed, read)
            path.write_bytes(content)
    return tally


def stand(folder: Path) -> None:
    """Read a robot and put it on its buses."""
    robot = load_robot(str(folder))
    wiring = wire(robot)
    SimulatedRobot(robot, wiring, SimulatedWires(wiring.buses, 10))
    open_driver(wiring)


def fuzz_policies(seeds: range) -> Tally:
    """A policy's file, its bytes or its contract changed; what still loads decides on one observation."""
    import onnx

    tally, robot = Tally(), load_robot(ROBOT)
    whole = (ZOO / POLICY / "policy.onnx").read_bytes()
    none, upright, joints = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(len(robot.joint_names))
    still = Sensed(none, none, upright, joints, joints, joints)
    observation = Observation(0.0, still, np.zeros(3), np.zeros(3), 0.3)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hurt.onnx"

        def read() -> None:
            policy = LearnedPolicy(path, robot)
            with suppress(Exception):  # the loop takes whatever a policy raises for a fault, and damps
                policy.act(observation)

        for seed in seeds:
            rng = np.random.default_rng(seed)
            if seed % 2:
                path.write_bytes(mutated(whole, rng))
            else:
                model = onnx.load_from_string(whole)
                for each in model.metadata_props:
                    contract = yaml.safe_load(each.value) if each.key == CONTRACT_KEY else None
                    if contract is not None:
                        each.value = json.dumps(with_a_change(contract, rng))
                path.write_bytes(model.SerializeToString())
            tally.attempt("policy", seed, read)
    return tally


FUZZ: dict[str, Callable[[range], Tally]] = {
    "logs": fuzz_logs,
    "frames": fuzz_frames,
    "yaml": fuzz_yaml,
    "policies": fuzz_policies,
}


def run_piece(piece: tuple[str, int, int]) -> dict[str, Any]:
    """What became of the cases from one seed up to another."""
    what, first, end = piece
    began, tally = time.perf_counter(), FUZZ[what](range(first, end))
    return {
        "what": what,
        "cases": end - first,
        "ends": tally.ends,
        "escaped": tally.escaped,
        "seconds": round(time.perf_counter() - began, 1),
    }


def summary(what: str, pieces: list[dict[str, Any]]) -> dict[str, Any]:
    """All pieces of a kind as one."""
    of = [each for each in pieces if each["what"] == what]
    readers: dict[str, Counter[str]] = {}
    for each in of:
        for reader, ends in each["ends"].items():
            readers.setdefault(reader, Counter()).update(ends)
    return {
        "what": what,
        "cases": sum(each["cases"] for each in of),
        "readers": readers,
        "escaped": sum(len(each["escaped"]) for each in of),
        "seconds": round(sum(each["seconds"] for each in of), 1),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--what", nargs="+", choices=FUZZ, default=list(FUZZ))
    parser.add_argument(
        "--count", type=int, help="cases of each (default: as many as the head of this file says)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the first case; the others follow")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", type=Path, help="file that keeps every piece; those in it are not run again")
    parser.add_argument("--time-limit", type=float, help="seconds until no piece begins")
    options = parser.parse_args()
    tasks = []
    for what in options.what:
        end, size = options.seed + (options.count or COUNTS[what]), PIECES[what]
        tasks += [(what, first, min(first + size, end)) for first in range(options.seed, end, size)]
    pieces, errors = run_kept(run_piece, tasks, options.out, options.workers, options.time_limit)
    for what in options.what:
        print(json.dumps(summary(what, pieces)), flush=True)
    escaped = {label: trace for each in pieces for label, trace in each["escaped"].items()}
    for label, trace in list(escaped.items())[:MOST_SHOWN]:
        print(f"-- {label}\n{trace}", file=sys.stderr)
    for line in errors:
        print(line, file=sys.stderr)
    return 1 if escaped or errors else 0


if __name__ == "__main__":
    sys.exit(main())
