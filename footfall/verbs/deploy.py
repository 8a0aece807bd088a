"""`footfall deploy`."""

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from cyclopts import Parameter

from footfall.common.outputs import check_outputs, write_json
from footfall.options import JsonFile, Plant, PolicyName, RobotName, Seconds, Seed, VelocityCommand

if TYPE_CHECKING:
    from footfall.plant.trace import Trace

SAFE = "IDLE"


@Parameter(name="*")
@dataclass(frozen=True)
class DeployOptions:
    """Where and how to run a policy."""

    robot: RobotName = "go1"
    bus: str = "sim"
    """sim for the simulated robot, or socketcan for the CAN interfaces that robot.yaml names."""
    command: VelocityCommand = (0.5, 0.0, 0.0)
    duration: Seconds = 10.0
    """Walking time, s."""
    realtime: bool = False
    """Keep to the wall clock; a bus other than sim always does."""
    plant: Plant = None
    ground_truth: bool = False
    """Hand the policy the simulator's base velocity instead of an estimate, for study."""
    config: Path | None = None
    """YAML file with settings of the loop and its safety limits (see docs/safety.md)."""
    log: Path | None = None
    """Record the run to this MCAP file."""
    seed: Seed = 0
    json: JsonFile = None


def deploy(policy: PolicyName, /, *, options: DeployOptions = DeployOptions()) -> int:
    """Run a policy on a bus, simulated by default; exit 0 if it ended safely, 1 if not."""
    check_outputs(options.json, options.log)
    from footfall.deploy.config import DeployConfig, load_deploy_config
    from footfall.plant.episode import Episode, run_episode
    from footfall.policies.registry import load_policy
    from footfall.robots.description import load_robot

    robot = load_robot(options.robot)
    command = np.array(options.command)
    trace = run_episode(
        robot,
        load_policy(policy, robot),
        Episode(
            command=lambda _: command,
            duration_s=options.duration,
            seed=options.seed,
            plant=options.plant,
            ground_truth=options.ground_truth,
            realtime=options.realtime,
            log=options.log,
            bus=options.bus,
            policy_spec=_lasting(policy),
            config=DeployConfig() if options.config is None else load_deploy_config(options.config),
        ),
    )
    figures = {"policy": policy, "robot": robot.name} | _figures(trace, options)
    write_json(options.json, figures)
    _show(figures)
    return 0 if trace.final_state == SAFE and not trace.fell else 1


def _lasting(policy: str) -> str:
    """A path that still holds from another folder; a name stays a name."""
    path = Path(policy)
    return str(path.resolve()) if path.exists() else policy


def distance_walked(trace: "Trace") -> float:
    """Length of the base's path over the ground, m, in chords of a second so that sway does not count."""
    stride = max(1, round(trace.record_rate_hz))
    path = trace.base_position[:, :2]
    points = np.concatenate([path[::stride], path[-1:]])
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


def _figures(trace: "Trace", options: DeployOptions) -> dict[str, Any]:
    walked = trace.time_s[-1] if len(trace.time_s) else 0.0
    return {
        "bus": options.bus,
        "seed": options.seed,
        "command": list(options.command),
        "duration_s": options.duration,
        "walked_s": float(walked),
        "final_state": trace.final_state,
        "fell": trace.fell,
        "fall_reason": trace.fall_reason,
        "distance_m": distance_walked(trace),
        "mean_velocity_m_s": trace.base_velocity.mean(axis=0) if walked else [math.nan] * 3,
        "faults": list(trace.faults),
        "notes": list(trace.notes),
        "timing": trace.timing,
        "buses": [asdict(bus) for bus in trace.buses],
        "wall_s": trace.wall_s,
        "simulated_s": trace.simulated_s,
    }


def _show(figures: dict[str, Any]) -> None:
    """A summary for people."""
    from rich.console import Console
    from rich.table import Table

    timing = figures["timing"]
    forward, leftward, _ = figures["mean_velocity_m_s"]
    rows = [
        ("final state", figures["final_state"]),
        ("walked", f"{figures['distance_m']:.2f} m in {figures['walked_s']:.1f} s"),
        ("mean velocity", f"{forward:.2f} m/s forward, {leftward:.2f} m/s left"),
        ("speed", f"{figures['simulated_s'] / max(figures['wall_s'], 1e-9):.1f} x real time"),
        ("tick", f"{timing['tick_us_p50']:.0f} us p50, {timing['tick_us_p99']:.0f} us p99"),
        ("policy step", f"{timing['policy_ms_p50']:.2f} ms p50, {timing['policy_ms_p99']:.2f} ms p99"),
    ]
    loads = [f"{bus['name']} {bus['load']:.0%}" for bus in figures["buses"] if bus["load"] is not None]
    if loads:
        rows.append(("bus load", ", ".join(loads)))
    rows += [("fault", fault) for fault in figures["faults"]]
    rows += [("fell", figures["fall_reason"])] if figures["fell"] else []
    rows += [("note", note) for note in figures["notes"]]
    table = Table(show_header=False, box=None, title=f"{figures['policy']} on {figures['robot']}")
    for row in rows:
        table.add_row(*row)
    Console().print(table, highlight=False)
