"""`footfall identify gains`: step responses of each joint, and the gains at which it rings."""

from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, write_json
from footfall.confirm import Yes, confirm
from footfall.options import SIMULATED, VIRTUAL, JsonFile, OptionalPath, RobotName, Seed
from footfall.robots.default import DEFAULT_ROBOT
from footfall.stand_bus import ON_STAND, SAFE, open_bus

if TYPE_CHECKING:
    from footfall.identify.gain_search import Tuned
    from footfall.robots.description import Robot


@Parameter(name="*")
@dataclass(frozen=True)
class GainOptions:
    """Which robot, and how its joints step."""

    robot: RobotName = DEFAULT_ROBOT
    bus: str = "sim"
    """As for `identify record`."""
    steps: OptionalPath = None
    """YAML file with settings of the steps (see docs/tuning.md)."""
    log: OptionalPath = None
    """Log of the run. It must not exist."""
    config: OptionalPath = None
    """YAML file with settings of the loop and its safety limits (see docs/safety.md)."""
    seed: Seed = 0
    yes: Yes = False
    json: JsonFile = None


def gains(*, options: GainOptions = GainOptions()) -> int:
    """Step each joint of a robot on a stand, and raise its gains until it rings; exit 1 if the run failed."""
    from footfall.common.config import load
    from footfall.deploy.config import deploy_config
    from footfall.identify.gain_search import GainConfig, GainSearch
    from footfall.identify.record import run_on_stand
    from footfall.robots.description import load_robot

    if options.log is not None and options.log.exists():
        raise UserError(f"{options.log} exists: give another name, nothing is overwritten")
    check_outputs(options.json, options.log)
    robot, simulated = load_robot(options.robot), options.bus == SIMULATED
    steps = GainConfig() if options.steps is None else load(options.steps, GainConfig)
    deploy = deploy_config(robot, options.config, simulated)
    if options.bus not in (SIMULATED, VIRTUAL):
        confirm(f"Each joint steps by {steps.step_rad:g} rad and may ring. {ON_STAND}?", options.yes)
    policy = GainSearch(robot, steps, deploy.joint_rate_hz)
    with ExitStack() as resources:
        bus = open_bus(robot, options.bus, None, options.seed, resources)
        outcome = run_on_stand(
            robot, policy, bus, policy.duration_s, deploy, not simulated, options.log, lambda: policy.done
        )
    for line in (*outcome.faults, *outcome.notes):
        print(line)
    tuned = {robot.joint_names[joint]: policy.tuned[joint] for joint in sorted(policy.tuned)}
    _show_gains(robot, tuned)
    write_json(options.json, {name: each.figures() for name, each in tuned.items()})
    return 0 if policy.done and outcome.final_state == SAFE and not outcome.faults else 1


def _show_gains(robot: "Robot", tuned: "dict[str, Tuned]") -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("joint", "rise, ms", "overshoot", "kp rings at", "kp", "kd rings at", "kd", box=None)
    for name, result in tuned.items():
        joint = robot.joint_names.index(name)
        cells = [f"{1e3 * result.own.rise_s:.0f}", f"{result.own.overshoot:.0%}"]
        for own, rings, share in (
            (robot.kp[joint], result.kp_rings, result.proposed.kp),
            (robot.kd[joint], result.kd_rings, result.proposed.kd),
        ):
            cells += ["–" if rings is None else f"{own * rings:.3g}", f"{own * share:.3g}"]
        table.add_row(name, *cells)
    Console().print(table, highlight=False)
