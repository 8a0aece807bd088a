"""`footfall log`: inspect, plot, cut and repair a run's log."""

import math
import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, Parameter

from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, write_json
from footfall.log_findings import findings_of, headline
from footfall.options import AS_TYPED, JsonFile, OptionalPath

log = App(name="log", help="Work on the log of a run.")

RobotOfLog = Annotated[str | None, AS_TYPED]


@log.command
def info(file: Path, /, *, robot: RobotOfLog = None) -> int:
    """Show what a log holds and how its run went; exit 1 after a fault or a jump in a path.

    Parameters
    ----------
    file
        The log.
    robot
        Name of a robot, or a folder with its robot.yaml (default: the one that the log names).
    """
    from rich.console import Console
    from rich.table import Table

    from footfall.deploy.telemetry.topics import TOPICS

    found = findings_of(file, robot)
    columns, console = found.columns, Console()
    for line in (headline(found), *found.verdicts()):
        console.print(line, highlight=False, soft_wrap=True)
    facts = Table(show_header=False, box=None)
    for what, value in found.extremes():
        facts.add_row(what, value)
    console.print(facts, highlight=False)
    topics = Table("topic", "message", "messages", "Hz", box=None)
    for topic, count in sorted(columns.counts.items()):
        kind = TOPICS[topic].kind if topic in TOPICS else ""
        rate = f"{(count - 1) / columns.duration_s:.1f}" if count > 1 and columns.duration_s else ""
        topics.add_row(topic, kind.replace("/msg/", "/"), str(count), rate)
    console.print(topics, highlight=False)
    return 0 if found.good else 1


@log.command
def compare(file: Path, /, *, robot: RobotOfLog = None, json: JsonFile = None) -> int:
    """Simulate the commands of a robot on a stand, and show each joint's error; exit 1 above the noise.

    Parameters
    ----------
    file
        The log, made by `footfall identify record` or of any policy on a robot whose base did not move.
    robot
        Name of a robot, or a folder with its robot.yaml (default: the one that the log names).
    """
    from footfall.deploy.log_analysis.robot import logged_robot
    from footfall.deploy.log_file import read_log
    from footfall.identify.compare import compare_leg
    from footfall.identify.leg import fixed_legs
    from footfall.identify.recording import read_recording
    from footfall.robots.description import load_robot

    check_outputs(json)
    model = logged_robot(read_log(file, topics=())) if robot is None else load_robot(robot)
    recording, figures, good = read_recording(file, model), {}, True
    for leg in fixed_legs(model):
        gap = compare_leg(leg, recording)
        for place, joint in enumerate(leg.joint_names):
            error, noise = 1e3 * gap.error_rad[place], 1e3 * gap.noise_rad[place]
            good &= error < 2.0 * noise
            print(
                f"{joint}: {error:.2f} mrad rms, noise {noise:.2f}: {gap.verdict(place)}",
                flush=True,
            )
            figures[joint] = {"error_mrad": error, "noise_mrad": noise, "explains": gap.explains[place]}
    write_json(json, figures)
    return 0 if good else 1


@log.command(name="import")
def import_(
    file: Path,
    /,
    *,
    columns: Annotated[Path, Parameter(name="--map")],
    robot: Annotated[str, AS_TYPED],
    config: OptionalPath = None,
    out: OptionalPath = None,
) -> int:
    """Write a CSV recording of any robot as a log, with its commands, estimated attitude and motion.

    Parameters
    ----------
    file
        The recording: a line with the columns' names, then a row for each time.
    columns
        YAML file that names the columns, see docs/logs.md.
    robot
        Name of the robot, or a folder with its robot.yaml.
    config
        YAML file with settings of the deploy loop; only the section `estimator` is used.
    out
        Where to write the log (default: FILE.mcap, beside it).
    """
    from footfall.common.config import load
    from footfall.deploy.config import deploy_config
    from footfall.deploy.log_analysis.import_csv import import_recording
    from footfall.deploy.log_analysis.recorded_csv import ColumnMap, read_csv
    from footfall.robots.description import load_robot

    target = file.with_suffix(".mcap") if out is None else out
    check_outputs(target)
    of = load_robot(robot)
    settings = deploy_config(of, config).estimator
    recorded = read_csv(file, load(columns, ColumnMap), of)
    done = import_recording(recorded, of, settings, target, str(file))
    motion = "estimated" if done.estimated else "left out: it needs an IMU, and forces or torques"
    print(f"{target}: {done.readings} readings of {done.duration_s:.1f} s{' with commands' * done.commanded}")
    print(f"attitude {done.attitude}; motion of the base {motion}")
    return 0


@log.command
def plot(file: Path, /, *, out: OptionalPath = None, robot: RobotOfLog = None) -> int:
    """Draw a log on one HTML page: joints, torques, heat, contacts, paths of the feet, timing, faults.

    Parameters
    ----------
    file
        The log.
    out
        Where to write the page (default: FILE.html, beside it).
    robot
        Name of a robot, or a folder with its robot.yaml (default: the one that the log names).
    """
    from footfall.evaluate.report.extra import check_installed

    page = file.with_suffix(".html") if out is None else out
    check_outputs(page)
    check_installed()
    found = findings_of(file, robot)
    from footfall.common.outputs import write_text
    from footfall.evaluate.report.log_page import render

    write_text(page, render(found, headline(found)))
    print(f"{page}: {' '.join(found.verdicts())}")
    return 0


@log.command
def cut(
    file: Path,
    /,
    *,
    start: Annotated[float, Parameter(name="--from")] = 0.0,
    end: Annotated[float, Parameter(name="--to")] = math.inf,
    out: OptionalPath = None,
) -> int:
    """Copy a time range of a log.

    Parameters
    ----------
    file
        The log.
    start
        Seconds from the log's start.
    end
        Likewise (default: the log's end).
    out
        Where to write the copy (default: FILE.cut.mcap, beside it).
    """
    if not 0.0 <= start < end:
        raise UserError(f"from {start:g} to {end:g} s is no time range: give --from and --to, s, in order")
    part = _beside(file, "cut", out)
    from footfall.deploy.recover import cut as cut_log

    found = cut_log(file, part, start, end)
    print(f"{found.messages} messages in {part}{_lost(found.damaged)}")
    return 0


@log.command
def frames(file: Path, /, *, out: OptionalPath = None) -> int:
    """Write a log's CAN frames as candump does; --log-frames of deploy records them.

    Parameters
    ----------
    file
        The log.
    out
        Where to write the text (default: to the terminal).
    """
    check_outputs(out)
    from footfall.deploy.log_analysis.candump import write_candump

    if out is None:
        write_candump(file, sys.stdout)
        return 0
    with out.open("w") as text:
        count = write_candump(file, text)
    print(f"{count} frames in {out}")
    return 0


@log.command
def layout(
    file: Path, /, *, tool: Literal["foxglove", "plotjuggler"] = "foxglove", out: OptionalPath = None
) -> int:
    """Write a layout for a viewer of logs, with plots by the names of the log's joints.

    Parameters
    ----------
    file
        The log, or another one of the same robot.
    tool
        foxglove, which Lichtblick imports as well, or plotjuggler.
    out
        Where to write it (default: ROBOT.foxglove.json or ROBOT.plotjuggler.xml, beside the log).
    """
    from footfall.common.outputs import write_text
    from footfall.deploy.log_analysis.layouts import LAYOUTS
    from footfall.deploy.log_file import read_log

    found = read_log(file, topics=())
    make, suffix = LAYOUTS[tool]
    target = file.parent / f"{found.text('robot')}.{tool}{suffix}" if out is None else out
    check_outputs(target)
    write_text(target, make(found.joints))
    print(f"{target}: import it in {tool}")
    return 0


@log.command
def recover(file: Path, /, *, out: OptionalPath = None) -> int:
    """Repair a log that was cut short or damaged, so that tools which need its index can open it.

    Parameters
    ----------
    file
        The log.
    out
        Where to write the whole copy (default: FILE.recovered.mcap, beside it).
    """
    whole = _beside(file, "recovered", out)
    from footfall.deploy.recover import recover as recover_log

    found = recover_log(file, whole)
    print(f"{found.messages} messages in {whole}{_lost(found.damaged)}")
    return 0


def _beside(file: Path, what: str, out: Path | None) -> Path:
    """Path of a copy of a log; raises UserError if it cannot be written."""
    copy = file.parent / f"{file.stem}.{what}{file.suffix}" if out is None else out
    check_outputs(copy)
    return copy


def _lost(damaged: int) -> str:
    return f", {damaged} damaged parts left out" if damaged else ""
