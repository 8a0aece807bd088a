"""`footfall identify`: a robot's parameters from its own motion."""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, NamedTuple

from cyclopts import App, Parameter

from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, write_json, write_text
from footfall.confirm import Yes, confirm
from footfall.options import AS_TYPED, SIMULATED, VIRTUAL, JsonFile, Names, OptionalPath, RobotName, Seed
from footfall.robots.default import DEFAULT_ROBOT
from footfall.stand_bus import ON_STAND, SAFE, open_bus
from footfall.verbs.identify_foot import foot
from footfall.verbs.identify_gains import gains

if TYPE_CHECKING:
    from footfall.identify.fit import LegFit
    from footfall.identify.leg import FixedLeg
    from footfall.identify.recording import Recording
    from footfall.learned_law import Comparison
    from footfall.robots.description import Robot

identify = App(name="identify", help="Find a robot's parameters from its own motion.")
identify.command(gains)
identify.command(foot)


@Parameter(name="*")
@dataclass(frozen=True)
class RecordOptions:
    """Robot, motion and bus."""

    robot: RobotName = DEFAULT_ROBOT
    bus: str = "sim"
    """sim for the simulated robot, socketcan for the CAN interfaces named in robot.yaml, or the name of
    another python-can interface; virtual includes a simulated robot."""
    plant: OptionalPath = None
    """MJCF of the simulated robot's body (default: the robot's own)."""
    excitation: OptionalPath = None
    """YAML file with the motion's settings (see docs/identify.md)."""
    config: OptionalPath = None
    """YAML file with settings of the loop and its safety limits (see docs/safety.md)."""
    seed: Seed = 0
    yes: Yes = False


@identify.command
def record(log: Path, /, *, options: RecordOptions = RecordOptions()) -> int:
    """Move the joints of a robot on a stand, and log each tick.

    Exit 1 if the run ends with a fault, or the log is incomplete.

    Parameters
    ----------
    log
        The MCAP file to write. It must not exist.
    """
    from footfall.common.config import load
    from footfall.deploy.config import deploy_config
    from footfall.identify.excitation import ExcitationConfig
    from footfall.identify.record import record as run
    from footfall.robots.description import load_robot

    if log.exists():
        raise UserError(f"{log} exists: give another name; files are not overwritten")
    check_outputs(log)
    if options.bus != SIMULATED and options.plant is not None:
        raise UserError("--plant is for the simulated robot: leave it out, or use --bus sim")
    robot, simulated = load_robot(options.robot), options.bus == SIMULATED
    motion = ExcitationConfig() if options.excitation is None else load(options.excitation, ExcitationConfig)
    deploy = deploy_config(robot, options.config, simulated)
    if options.bus not in (SIMULATED, VIRTUAL):
        confirm(f"All joints move, up to {motion.amplitude_rad:g} rad. {ON_STAND}?", options.yes)
    with ExitStack() as resources:
        bus = open_bus(robot, options.bus, options.plant, options.seed, resources)
        outcome = run(robot, bus, log, motion, deploy, realtime=not simulated)
    for line in (*outcome.faults, *outcome.notes):
        print(line)
    if outcome.missing_in_log:
        print(f"{log} is incomplete: do not fit it; record again")
        return 1
    print(f"{log}: {outcome.walked_s:.1f} s of motion")
    return 0 if outcome.final_state == SAFE and not outcome.faults else 1


@Parameter(name="*")
@dataclass(frozen=True)
class FitOptions:
    """Held-out motion, effects and output of a fit."""

    robot: Annotated[str | None, AS_TYPED] = None
    """Name of a robot, or a folder with its robot.yaml (default: the robot of the first log)."""
    held_out: OptionalPath = None
    """Held-out log for the evaluation of the fit (default: every fourth second of each log)."""
    legs: Names = ()
    """Only these legs, by the names of their feet."""
    effects: Names = ()
    """Fit these effects, too: stribeck_friction, load_friction, backlash_rad, gear_compliance, link_com."""
    profile: bool = False
    """Fit again with other fixed delays, to show how much the motion depends on the delay."""
    out: OptionalPath = None
    """Folder for the proposed robot; must not exist."""
    report: OptionalPath = None
    """HTML page with estimates, residuals, intervals and misfit."""
    json: JsonFile = None


@identify.command
def fit(*logs: Path, options: FitOptions = FitOptions()) -> int:
    """Fit a robot's parameters to logs of `identify record`; exit 1 if the model does not fit the motion.

    Parameters
    ----------
    logs
        The logs.
    """
    from footfall.identify.fit import MISFIT_RATIO, FitConfig, fit_leg
    from footfall.identify.parameters import EFFECTS
    from footfall.identify.proposal import propose

    check_outputs(options.json, options.report, inputs=[*logs, options.held_out])
    if options.report is not None:
        from footfall.evaluate.report.extra import check_installed

        check_installed()
    for name in options.effects:
        if name not in EFFECTS:
            raise UserError(f"no effect '{name}': there are {', '.join(EFFECTS)}")
    inputs = _read(logs, options)
    fits, config = [], FitConfig(effects=tuple(options.effects), profile=options.profile)
    for leg in inputs.legs:
        fits.append(fit_leg(leg, inputs.recordings, inputs.held_out, config))
        _show(fits[-1])
    _write(options, inputs.robot, fits, logs)
    if options.out is not None:
        folder = propose(inputs.robot, fits, [str(log) for log in logs], options.out)
        print(f"wrote {folder}: check it with: footfall robot check {folder}")
    return 1 if any((each.misfit > MISFIT_RATIO).any() for each in fits) else 0


class _Inputs(NamedTuple):
    """Inputs of a fit or a training."""

    robot: "Robot"
    recordings: "list[Recording]"
    held_out: "list[Recording]"
    legs: "list[FixedLeg]"


def _read(logs: tuple[Path, ...], options: "FitOptions | NetOptions") -> _Inputs:
    """Robot, legs and logs. Raises UserError if they do not match, or the output folder exists."""
    from footfall.deploy.log_analysis.robot import logged_robot
    from footfall.deploy.log_file import read_log
    from footfall.identify.leg import fixed_legs
    from footfall.identify.recording import read_recording
    from footfall.robots.description import load_robot

    if not logs:
        raise UserError("no log: record one with 'footfall identify record LOG'")
    if options.out is not None and options.out.exists():
        raise UserError(f"{options.out} exists: give another --out; files are not overwritten")
    check_outputs(options.out)
    log_paths = [log.resolve() for log in (*logs, *([] if options.held_out is None else [options.held_out]))]
    if len(set(log_paths)) < len(log_paths):
        raise UserError("a log is named twice: each log counts once, and --held-out is a log of its own")
    robot = logged_robot(read_log(logs[0], topics=())) if options.robot is None else load_robot(options.robot)
    recordings = [read_recording(log, robot) for log in logs]
    held_out = [] if options.held_out is None else [read_recording(options.held_out, robot)]
    legs = fixed_legs(robot)
    for name in options.legs:
        if name not in [leg.name for leg in legs]:
            raise UserError(f"no leg '{name}': there are {', '.join(leg.name for leg in legs)}")
    chosen = [leg for leg in legs if not options.legs or leg.name in options.legs]
    return _Inputs(robot, recordings, held_out, chosen)


@Parameter(name="*")
@dataclass(frozen=True)
class NetOptions:
    """Held-out motion, duration of the training, and output."""

    robot: Annotated[str | None, AS_TYPED] = None
    """Name of a robot, or a folder with its robot.yaml (default: the robot of the first log)."""
    held_out: OptionalPath = None
    """Held-out log for the evaluation of fit and net (default: every fourth second of each log)."""
    legs: Names = ()
    """Only these legs, by the names of their feet; other joints get no net."""
    steps: int = 300
    """Gradient steps of each training."""
    seeds: int = 2
    """Trainings of each leg; the one with the best result on unseen seconds is kept."""
    seed: Seed = 0
    out: OptionalPath = None
    """Folder for the proposed robot; must not exist."""
    json: JsonFile = None


@identify.command
def net(*logs: Path, options: NetOptions = NetOptions()) -> int:
    """Fit logs, then train a net for the rest of the joint torque; exit 1 if it predicts no better.

    Parameters
    ----------
    logs
        The logs. The last of several logs decides which net is kept.
    """
    from footfall.identify.fit import FitConfig, fit_leg
    from footfall.train.entry import learning_libraries

    with learning_libraries():
        from footfall.learned_law import learn
        from footfall.train.actuator_net import NetConfig
    check_outputs(options.json, inputs=[*logs, options.held_out])
    try:
        config = NetConfig(steps=options.steps, seeds=options.seeds, seed=options.seed)
    except ValueError as error:
        raise UserError(str(error)) from None
    inputs = _read(logs, options)
    if inputs.robot.actuator_net is not None:
        raise UserError(
            f"{inputs.robot.name} has an actuator net: train a new one with the robot folder without it"
        )
    fit_config = FitConfig(explain=False)
    fits = [fit_leg(leg, inputs.recordings, inputs.held_out, fit_config) for leg in inputs.legs]
    with TemporaryDirectory() as temporary:
        folder = Path(temporary) / "robot"
        compared = learn(inputs.robot, fits, inputs.recordings, inputs.held_out, folder, config)
        _show_errors(compared)
        write_json(options.json, [each.figures() for each in compared])
        if options.out is not None:
            copytree(folder, options.out)
            print(f"wrote {options.out}: check it with: footfall robot check {options.out}")
    worse = [each.leg.name for each in compared if not each.better]
    if worse:
        print(f"the net is no better than the fitted law: {', '.join(worse)}")
    return 1 if worse else 0


def _show_errors(compared: "list[Comparison]") -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table("held out, mrad rms", "nominal", "fitted law", "net", box=None)
    for row in (row for each in compared for row in each.rows()):
        table.add_row(*row)
    Console().print(table, highlight=False)


def _write(options: FitOptions, robot: "Robot", fits: "list[LegFit]", logs: tuple[Path, ...]) -> None:
    """Write the figures and the page."""
    from footfall.fit_findings import figures

    write_json(options.json, figures(fits))
    if options.report is not None:
        from footfall.fit_report import page

        write_text(options.report, page(robot, fits, logs, options.held_out))
        print(f"wrote {options.report}")


def _show(leg_fit: "LegFit") -> None:
    """Print the table and the verdict of a leg."""
    from rich.console import Console
    from rich.table import Table

    from footfall.fit_findings import verdicts
    from footfall.identify.proposal import table_rows

    console = Console()
    table = Table(
        "joint or body", "quantity", "value", "95 % interval", "unit", box=None, title=leg_fit.leg.name
    )
    for row in table_rows([leg_fit]):
        table.add_row(*row)
    console.print(table, highlight=False)
    for line in verdicts(leg_fit):
        print(line, flush=True)
