"""Malformed input to every reader: no input may cause a traceback or an unsafe command.

    python benchmarks/fuzz.py [--what logs frames yaml policies] [--count N] [--workers 1] [--out FILE]

`logs`: a run's log with bytes or records changed, to reading, replay and recovery. `frames`: random and
mutated CAN frames to the joint layer and to the motors. After each batch, a command's frames are checked
against the robot's limits. Drivers know their motors' settings, or still query them. `yaml`:
settings and descriptions with bytes and values changed, to their readers. `policies`: ONNX files with bytes
and contracts changed.

Cases are run in pieces, and each piece's result is a line of --out. A run that was stopped, or that
--time-limit ended, continues from that file. Prints a JSON object for each kind, with counts of cases for
each reader (of batches for `frames`). Exit status 1 if there was an unexpected exception.
"""

import argparse
import json
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from fuzz_frames import ROBOT, fuzz_frames
from fuzz_tally import Tally
from mutate import mutated, mutated_records, mutated_yaml, with_a_change
from resumable_runs import add_options, run_resumable

import footfall.policies
from footfall.deploy.config import deploy_config
from footfall.deploy.drivers.choice import open_driver
from footfall.deploy.log_file import read_log
from footfall.deploy.recover import recover
from footfall.deploy.replay import replay
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.randomisation import DEFAULT as RANDOMISATION
from footfall.domain_rand.randomisation import load_randomisation
from footfall.evaluate.scenarios import DEFAULT as SCENARIOS
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.policies.contract import CONTRACT_KEY
from footfall.policies.learned import LearnedPolicy
from footfall.policies.policy import PolicyInput, Sensed
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot
from footfall.train.config import PRESETS, load_preset

POLICY = "go1-flat"
ZOO = Path(footfall.policies.__file__).parent / "zoo"
COUNTS = {"logs": 600, "frames": 10_000_000, "yaml": 2000, "policies": 600}
PIECES = {"logs": 20, "frames": 102_400, "yaml": 60, "policies": 60}  # cases of each
MAX_SHOWN = 20  # tracebacks
LOOP = """
joint_rate_hz: 500
stand_s: 1.0
realtime_priority: 80
estimator_rate_hz: 250
safety: {silence_timeout_s: 0.05, tilt_limit_rad: 1.05, damping_kd: 3.0, sensors: {drift_rad: 0.2}}
"""


@cache
def walk_log() -> bytes:
    """Log of a walk of one second."""
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
        damaged, recovered = Path(folder) / "damaged.mcap", Path(folder) / "recovered.mcap"
        for seed in seeds:
            mutation = mutated_records if seed % 2 else mutated
            damaged.write_bytes(mutation(walk_log(), np.random.default_rng(seed)))
            tally.attempt("read", seed, lambda: read_log(damaged))
            tally.attempt("replay", seed, lambda: replay(damaged, policy))
            tally.attempt("recover", seed, lambda: recover(damaged, recovered))
    return tally


def fuzz_yaml(seeds: range) -> Tally:
    """Each reader of settings in turn, on one mutated file a seed."""
    tally, robot = Tally(), load_robot(ROBOT)
    with tempfile.TemporaryDirectory() as folder:
        copy, file = Path(folder) / ROBOT, Path(folder) / "damaged.yaml"
        shutil.copytree(robot.folder, copy)
        readers: list[tuple[str, bytes, Path, Callable[[], object]]] = [
            ("robot", (robot.folder / "robot.yaml").read_bytes(), copy / "robot.yaml", lambda: connect(copy)),
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


def connect(folder: Path) -> None:
    """Read a robot and connect it to its buses."""
    robot = load_robot(str(folder))
    wiring = wiring_of(robot)
    SimulatedRobot(robot, wiring, SimulatedWires(wiring.buses, 10))
    open_driver(wiring)


def fuzz_policies(seeds: range) -> Tally:
    """ONNX files with changed bytes or contract; a policy that still loads acts once."""
    import onnx

    tally, robot = Tally(), load_robot(ROBOT)
    original = (ZOO / POLICY / "policy.onnx").read_bytes()
    zero, upright, joints = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(len(robot.joint_names))
    still = Sensed(zero, zero, upright, joints, joints, joints)
    inputs = PolicyInput(0.0, still, np.zeros(3), np.zeros(3), 0.3)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "damaged.onnx"

        def read() -> None:
            policy = LearnedPolicy(path, robot)
            with suppress(Exception):  # the loop treats what a policy raises as a fault, and damps
                policy.act(inputs)

        for seed in seeds:
            rng = np.random.default_rng(seed)
            if seed % 2:
                path.write_bytes(mutated(original, rng))
            else:
                model = onnx.load_from_string(original)
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
    """Results of the cases of one piece: kind, first seed, end."""
    what, first, end = piece
    began, tally = time.perf_counter(), FUZZ[what](range(first, end))
    return {
        "what": what,
        "cases": end - first,
        "outcomes": tally.outcomes,
        "unexpected": tally.unexpected,
        "seconds": round(time.perf_counter() - began, 1),
    }


def summary(what: str, pieces: list[dict[str, Any]]) -> dict[str, Any]:
    """All pieces of a kind as one."""
    chosen = [each for each in pieces if each["what"] == what]
    readers: dict[str, Counter[str]] = {}
    for each in chosen:
        for reader, counts in each["outcomes"].items():
            readers.setdefault(reader, Counter()).update(counts)
    return {
        "what": what,
        "cases": sum(each["cases"] for each in chosen),
        "readers": readers,
        "unexpected": sum(len(each["unexpected"]) for each in chosen),
        "seconds": round(sum(each["seconds"] for each in chosen), 1),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--what", nargs="+", choices=FUZZ, default=list(FUZZ))
    parser.add_argument("--count", type=int, help="cases of each kind (default: COUNTS in this file)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first case; the others follow")
    add_options(parser)
    options = parser.parse_args()
    tasks = []
    for what in options.what:
        end, size = options.seed + (options.count or COUNTS[what]), PIECES[what]
        tasks += [(what, first, min(first + size, end)) for first in range(options.seed, end, size)]
    pieces, errors = run_resumable(run_piece, tasks, options.out, options.workers, options.time_limit)
    for what in options.what:
        print(json.dumps(summary(what, pieces)), flush=True)
    unexpected = {label: trace for each in pieces for label, trace in each["unexpected"].items()}
    for label, trace in list(unexpected.items())[:MAX_SHOWN]:
        print(f"-- {label}\n{trace}", file=sys.stderr)
    for line in errors:
        print(line, file=sys.stderr)
    return 1 if unexpected or errors else 0


if __name__ == "__main__":
    sys.exit(main())
