"""`footfall identify foot`: how closely one foot reaches positions, and how hard it presses on a scale."""

import math
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, write_json
from footfall.confirm import Yes, ask, confirm
from footfall.options import SIMULATED, VIRTUAL, JsonFile, OptionalPath, RobotName, Seed
from footfall.robots.default import DEFAULT_ROBOT
from footfall.stand_bus import ON_STAND, SAFE, open_bus

if TYPE_CHECKING:
    import numpy as np

    from footfall.deploy.bus import Bus
    from footfall.identify.foot_test import FootTestConfig, Measurement


@Parameter(name="*")
@dataclass(frozen=True)
class FootOptions:
    """Which robot, and what its foot does."""

    robot: RobotName = DEFAULT_ROBOT
    bus: str = "sim"
    """As for `identify record`."""
    press: bool = False
    """Press on a scale under the foot instead of moving in the air; asks for its readings."""
    motion: OptionalPath = None
    """YAML file with settings and limits of the test (see docs/bring_up.md)."""
    config: OptionalPath = None
    """YAML file with settings of the loop and its safety limits (see docs/safety.md)."""
    seed: Seed = 0
    yes: Yes = False
    json: JsonFile = None


def foot(name: str, /, *, options: FootOptions = FootOptions()) -> int:
    """Test one foot of a robot on a stand: positions, or forces on a scale; exit 1 if it fails.

    Parameters
    ----------
    name
        Name of the foot.
    """
    from footfall.common.config import load
    from footfall.deploy.config import deploy_config
    from footfall.identify.foot_test import (
        FootTest,
        FootTestConfig,
        press_findings,
        presses,
        reach_findings,
        reaches,
    )
    from footfall.identify.record import run_on_stand
    from footfall.identify.simulated import on_scales
    from footfall.robots.description import load_robot

    check_outputs(options.json)
    robot, simulated = load_robot(options.robot), options.bus == SIMULATED
    names = [each.name for each in robot.description.feet]
    if name not in names:
        raise UserError(f"no foot '{name}': there are {', '.join(names)}")
    if options.press and options.bus == VIRTUAL:
        raise UserError("--press needs a scale: use --bus sim, or the bus of a robot")
    if options.press and not simulated and not sys.stdin.isatty():
        raise UserError("--press asks for the scale's readings: start it in a terminal")
    config = FootTestConfig() if options.motion is None else load(options.motion, FootTestConfig)
    deploy = deploy_config(robot, options.config, simulated)
    holds = presses(robot, config) if options.press else reaches(config)
    if options.bus not in (SIMULATED, VIRTUAL):
        confirm(_question(name, config, options.press), options.yes)
    leg = names.index(name)
    with ExitStack() as resources:
        policy = FootTest(robot, leg, holds, config, deploy.joint_rate_hz)
        bus: Bus
        if options.press and simulated:
            bus, weigh = on_scales(robot, seed=options.seed)
            policy = FootTest(robot, leg, holds, config, deploy.joint_rate_hz, lambda: weigh(leg))
        else:
            bus = open_bus(robot, options.bus, None, options.seed, resources)
        duration_s = policy.duration_s + 1.0
        outcome = run_on_stand(
            robot, policy, bus, duration_s, deploy, not simulated, done=lambda: policy.done
        )
    for line in (*outcome.faults, *outcome.notes):
        print(line)
    if not policy.done or outcome.final_state != SAFE or outcome.faults:
        return 1
    measured = policy.measured
    if options.press and not simulated:
        measured = [_with_scale_reading(each) for each in measured]
    _show(measured, options.press)
    findings = press_findings(measured, config) if options.press else reach_findings(measured, config)
    write_json(
        options.json, {"foot": name, "held": [_figures(each) for each in measured], "findings": findings}
    )
    print("\n".join(findings) or "passed")
    return 1 if findings else 0


def _question(name: str, config: "FootTestConfig", press: bool) -> str:
    if not press:
        return f"Foot {name} moves by {config.reach_m:g} m in all directions. {ON_STAND}?"
    return (
        f"Foot {name} presses {len(config.presses)} times, {config.press_s:g} s each: note what the scale"
        " shows each time. Is the robot bolted to a stand, the scale just under this foot, the others in the"
        " air?"
    )


def _with_scale_reading(measured: "Measurement") -> "Measurement":
    """The hold with the scale's reading, which the user enters."""
    while True:
        try:
            shown_kg = float(ask(f"scale at {measured.hold.force_n:.0f} N, kg: "))
        except ValueError:
            shown_kg = math.nan
        if math.isfinite(shown_kg):
            return measured._replace(scale_n=GRAVITY_M_S2 * shown_kg)
        print("a number in kg is needed, such as 1.25")


def _figures(measured: "Measurement") -> dict[str, Any]:
    """Plain values for a file."""
    return {
        "commanded_offset_m": measured.hold.offset.tolist(),
        "offset_m": measured.offset.tolist(),
        "commanded_force_n": measured.hold.force_n,
        "force_n": measured.force_n,
        "scale_n": measured.scale_n if math.isfinite(measured.scale_n) else None,
    }


def _show(measured: "Sequence[Measurement]", press: bool) -> None:
    from rich.console import Console
    from rich.table import Table

    def vector(metres: "np.ndarray") -> str:
        rounded = (round(1e3 * each, 1) + 0.0 for each in metres.tolist())  # + 0.0 shows -0.0 as +0.0
        return " ".join(f"{each:+.1f}" for each in rounded)

    if press:
        table = Table("commanded, N", "by the motors, N", "on the scale, N", box=None)
        for each in measured:
            forces = each.hold.force_n, each.force_n, each.scale_n
            table.add_row(*(f"{force:.1f}" for force in forces))
    else:
        table = Table("foot moves to x y z, mm", "it is at, mm", box=None)
        for each in measured:
            table.add_row(vector(each.hold.offset), vector(each.offset))
    Console().print(table, highlight=False)
