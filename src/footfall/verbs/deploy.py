"""`footfall deploy`."""

import math
from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.common.files import release, spare_descriptors
from footfall.common.outputs import check_outputs
from footfall.options import (
    ControllerSettings,
    JsonFile,
    OptionalPath,
    Plant,
    PolicyName,
    RobotName,
    Seconds,
    Seed,
    Share,
    VelocityCommand,
)
from footfall.robots.default import DEFAULT_ROBOT

if TYPE_CHECKING:
    from footfall.deploy.config import DeployConfig
    from footfall.deploy.loop import ControlLoop
    from footfall.deploy.session import SessionResult
    from footfall.policies.policy import Policy
    from footfall.robots.description import Robot

Others = Mapping[str, "Policy"]  # by spec
SAFE, FALLEN = "IDLE", "FALLING"  # final states
LYING = "lying"
FULL = 1.0
WIRING_CHECK = "first a wiring check: one joint after the other moves a little, nobody within reach"
SIMULATED, VIRTUAL = "sim", "virtual"  # buses that lead to a simulated robot


@Parameter(name="*")
@dataclass(frozen=True)
class DeployOptions:
    """Where and how to run a policy."""

    robot: RobotName = DEFAULT_ROBOT
    also: Annotated[tuple[PolicyName, ...], Parameter(negative=(), show_default=False)] = ()
    """Another policy that may take over while it walks; may be given several times."""
    bus: str = "sim"
    """sim for the simulated robot, socketcan for the CAN interfaces that robot.yaml names, or python-can's
    name of another kind; virtual has a simulated robot at its other end."""
    command: VelocityCommand = (0.5, 0.0, 0.0)
    duration: Seconds = 10.0
    """Walking time, s."""
    start: Literal["standing", "lying"] = "standing"
    """How the simulated robot begins."""
    charge: Share = FULL
    """Charge of the simulated robot's battery at the start, where its robot.yaml declares one."""
    lie_down: bool = True
    """Lie down before the motors go off, where robot and fault permit it."""
    realtime: bool = False
    """Keep to the wall clock; a bus other than sim always does."""
    plant: Plant = None
    ground: str = ""
    """What the simulated robot walks on: a name with changes, such as stairs,step_m=0.1, or a .npy or .png
    file (see docs/terrain.md). Flat if none is given."""
    ground_truth: bool = False
    """Hand the policy the simulator's base velocity instead of an estimate, for study."""
    config: OptionalPath = None
    """YAML file with settings of the loop and its safety limits (see docs/safety.md)."""
    wiring: Literal["auto", "check", "trust"] = "auto"
    """auto checks a real robot's wiring in its first run; check does so in this run, also a simulated one;
    trust runs on wiring that is not proven (see docs/bring_up.md)."""
    log: OptionalPath = None
    """Record the run to this MCAP file."""
    log_frames: bool = False
    """Record each CAN frame to the log, too."""
    feed: OptionalPath = None
    """Unix socket at which other programs read what the run tells, as it happens (see docs/logs.md)."""
    seed: Seed = 0
    settings: ControllerSettings = ()
    json: JsonFile = None


def deploy(policy: PolicyName, /, *, options: DeployOptions = DeployOptions()) -> int:
    """Run a policy on a bus, simulated by default; exit 0 if it ended safely, 1 if not."""
    check_outputs(options.json, options.log)
    from footfall.common.config import unstructure
    from footfall.policies.registry import lasting_spec, load_policy, load_settings
    from footfall.policies.spec import add_settings
    from footfall.result import write_and_show
    from footfall.robots.description import load_robot

    robot = load_robot(options.robot)
    spec, *also = add_settings([policy, *options.also], options.settings)
    decider = load_policy(spec, robot)
    others = {lasting_spec(each): load_policy(each, robot) for each in also}
    run = _simulated if options.bus == SIMULATED else _on_interface
    about = {"policy": spec, "robot": robot.name, "settings": unstructure(load_settings(spec, robot))}
    with spare_descriptors() as spare:
        figures = about | run(robot, decider, lasting_spec(spec), others, options)
        release(spare)
        status = 0 if figures["final_state"] == SAFE and not figures["fell"] else 1
        return write_and_show(figures, options.json, lambda: _show(figures), status)


def _simulated(
    robot: "Robot", policy: "Policy", spec: str, others: "Others", options: DeployOptions
) -> dict[str, Any]:
    """A run on the simulated robot; what it has to tell."""
    from footfall.deploy.wiring_check.proof import must_check
    from footfall.live_state import live_state
    from footfall.plant.episode import Episode, run_episode
    from footfall.terrain.declaration import load_ground

    command = np.array(options.command)
    episode = Episode(
        command_source=lambda _: command,
        duration_s=options.duration,
        seed=options.seed,
        plant=options.plant,
        ground=load_ground(options.ground, options.seed) if options.ground else None,
        lying=options.start == LYING,
        charge=options.charge,
        lie_down=options.lie_down,
        ground_truth=options.ground_truth,
        realtime=options.realtime,
        log=options.log,
        log_frames=options.log_frames,
        feed=options.feed,
        policy_spec=spec,
        others=others,
        record=False,
        config=_config(robot, options),
        display=partial(live_state, duration_s=options.duration),
        check_wiring=must_check(robot, options.bus, options.wiring),
    )
    trace = run_episode(robot, policy, episode)
    return _figures(trace, options) | {
        "fell": trace.fell,
        "fall_reason": trace.fall_reason,
        "distance_m": trace.distance_m,
        "mean_velocity_m_s": trace.mean_velocity,
    }


def _on_interface(
    robot: "Robot", policy: "Policy", spec: str, others: "Others", options: DeployOptions
) -> dict[str, Any]:
    """A run on CAN interfaces; what it has to tell."""
    from footfall.deploy.session import Session, run_on_interface
    from footfall.deploy.wiring_check.proof import keep_proof, must_check, unproven_note
    from footfall.live_state import live_state

    if what := _for_simulation_alone(options):
        raise UserError(f"{what} needs the simulated robot: leave --bus at '{SIMULATED}'")
    command = np.array(options.command)
    facts = {"seed": options.seed, "policy_spec": spec, "bus": options.bus, "plant": None}
    check = must_check(robot, options.bus, options.wiring)
    notes = [] if check else [unproven_note(robot, options.bus)]
    said = [*filter(None, notes), *[WIRING_CHECK] * check]
    if robot.description.held_start:
        said.append(f"{robot.name} cannot stand still: hold it up, let it go once it steps in place")

    def display(loop: "ControlLoop") -> AbstractContextManager[None]:
        for line in said:  # the buses are open, and nothing has moved
            print(line, flush=True)
        return live_state(loop, lambda: loop.estimate[0], options.duration)

    session = Session(
        command_source=lambda _: command,
        duration_s=options.duration,
        log=options.log,
        feed=options.feed,
        facts=facts,
        others=others,
        config=_config(robot, options),
        lie_down=options.lie_down,
        display=display,
        check_wiring=check,
        wiring_right=lambda verdicts: notes.append(keep_proof(robot, options.bus, verdicts)),
    )
    with ExitStack() as resources:
        if options.bus == VIRTUAL:  # reaches no further than this process, so the robot has to be in it
            from footfall.plant.serve import serving

            resources.enter_context(serving(robot, VIRTUAL, seed=options.seed))
        outcome = run_on_interface(robot, policy, options.bus, session)
    tipped = outcome.final_state == FALLEN
    return _figures(outcome, options) | {
        "notes": [*outcome.notes, *filter(None, notes)],
        "fell": tipped,
        "fall_reason": outcome.faults[0] if tipped else "",
        "distance_m": math.nan,  # not measured
        "mean_velocity_m_s": [math.nan] * 3,
    }


def _for_simulation_alone(options: DeployOptions) -> str:
    """The first option given that no bus but the simulated one has a use for; empty if none is."""
    given = {
        "--plant": options.plant is not None,
        "--ground": bool(options.ground),
        "--ground-truth": options.ground_truth,
        "--start": options.start == LYING,
        "--charge": options.charge != FULL,
    }
    return next((option for option, is_given in given.items() if is_given), "")


def _config(robot: "Robot", options: DeployOptions) -> "DeployConfig":
    from footfall.deploy.config import deploy_config

    return deploy_config(robot, options.config, simulated=options.bus == SIMULATED)


def _figures(outcome: "SessionResult", options: DeployOptions) -> dict[str, Any]:
    """What every run has to tell."""
    return {
        "bus": options.bus,
        "seed": options.seed,
        "command": list(options.command),
        "duration_s": options.duration,
        "walked_s": outcome.walked_s,
        "final_state": outcome.final_state,
        "faults": list(outcome.faults),
        "notes": list(outcome.notes),
        "timing": outcome.timing,
        "buses": [asdict(bus) for bus in outcome.buses],
        "wall_s": outcome.wall_s,
        "run_s": outcome.run_s,
    }


def _show(figures: dict[str, Any]) -> None:
    """A summary for people."""
    from rich.console import Console
    from rich.table import Table

    timing = figures["timing"]
    forward, leftward, _ = figures["mean_velocity_m_s"]
    measured = math.isfinite(forward)
    distance = f"{figures['distance_m']:.2f} m in " if measured else ""
    rows = [
        ("final state", figures["final_state"]),
        ("walked", f"{distance}{figures['walked_s']:.1f} s"),
        *([("mean velocity", f"{forward:.2f} m/s forward, {leftward:.2f} m/s left")] if measured else []),
        ("speed", f"{figures['run_s'] / max(figures['wall_s'], 1e-9):.1f} x real time"),
        ("tick", f"{timing['tick_us_p50']:.0f} us p50, {timing['tick_us_p99']:.0f} us p99"),
        ("policy step", f"{timing['policy_ms_p50']:.2f} ms p50, {timing['policy_ms_p99']:.2f} ms p99"),
    ]
    if timing["lateness_us_max"]:
        late = "{lateness_us_p50:.0f} us p50, {lateness_us_p99:.0f} us p99"
        long = "{overruns:.0f} of {ticks:.0f} ticks, {ticks_skipped:.0f} were left out"
        rows += [("lateness", late.format(**timing)), ("took too long", long.format(**timing))]
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
