"""`footfall log`: inspect, plot, cut and repair the log of a run."""

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
    """Show the contents of a log and findings about its run; exit 1 after a fault or a jump in a path.

    Parameters
    ----------
    file
        The log.
    robot
        Name of a robot, or a folder with its robot.yaml (default: the log's robot).
    """
    from rich.console import Console
    from rich.table import Table

    from footfall.deploy.telemetry.topics import TOPICS

    findings = findings_of(file, robot)
    columns, console = findings.columns, Console()
    for line in (headline(findings), *findings.verdicts()):
        console.print(line, highlight=False, soft_wrap=True)
    facts = Table(show_header=False, box=None)
    for name, value in findings.extremes():
        facts.add_row(name, value)
    console.print(facts, highlight=False)
    topics = Table("topic", "message", "messages", "Hz", box=None)
    for topic, count in sorted(columns.counts.items()):
        kind = TOPICS[topic].kind if topic in TOPICS else ""
        rate = f"{(count - 1) / columns.duration_s:.1f}" if count > 1 and columns.duration_s else ""
        topics.add_row(topic, kind.replace("/msg/", "/"), str(count), rate)
    console.print(topics, highlight=False)
    return 0 if findings.good else 1


@log.command
def compare(file: Path, /, *, robot: RobotOfLog = None, json: JsonFile = None) -> int:
    """Simulate the commands of a robot on a stand, and show each joint's error; exit 1 above the noise.

    Parameters
    ----------
    file
        The log, from `footfall identify record` or from any policy on a robot with a fixed base.
    robot
        Name of a robot, or a folder with its robot.yaml (default: the log's robot).
    """
    from footfall.deploy.log_analysis.robot import logged_robot
    from footfall.deploy.log_file import read_log
    from footfall.identify.compare import compare_leg
    from footfall.identify.leg import fixed_legs
    from footfall.identify.recording import read_recording
    from footfall.robots.description import load_robot

    check_outputs(json, inputs=[file])
    model = logged_robot(read_log(file, topics=())) if robot is None else load_robot(robot)
    recording, figures, good = read_recording(file, model), {}, True
    for leg in fixed_legs(model):
        gap = compare_leg(leg, recording)
        for index, joint in enumerate(leg.joint_names):
            error, noise = 1e3 * gap.error_rad[index], 1e3 * gap.noise_rad[index]
            good &= error < 2.0 * noise
            print(
                f"{joint}: {error:.2f} mrad rms, noise {noise:.2f}: {gap.verdict(index)}",
                flush=True,
            )
            figures[joint] = {"error_mrad": error, "noise_mrad": noise, "explains": gap.explains[index]}
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
    """Convert a CSV recording of any robot to a log, with its commands, estimated attitude and motion.

    Parameters
    ----------
    file
        The recording: a line with the names of the columns, then one row for each time.
    columns
        YAML file with the meaning of the columns, see docs/logs.md.
    robot
        Name of the robot, or a folder with its robot.yaml.
    config
        YAML file with settings of the deploy loop; only the section `estimator` is used.
    out
        Log to write (default: FILE.mcap, in the same folder).
    """
    from footfall.common.config import load
    from footfall.deploy.config import deploy_config
    from footfall.deploy.log_analysis.import_csv import import_recording
    from footfall.deploy.log_analysis.recorded_csv import ColumnMap, read_csv
    from footfall.robots.description import load_robot

    target = _beside(file, ".mcap", out)
    check_outputs(target, inputs=[file, columns, config])
    model = load_robot(robot)
    settings = deploy_config(model, config).estimator
    recorded = read_csv(file, load(columns, ColumnMap), model)
    imported = import_recording(recorded, model, settings, target, str(file))
    motion = "estimated" if imported.estimated else "not estimated: it needs an IMU, and forces or torques"
    commands = " with commands" if imported.commanded else ""
    print(f"{target}: {imported.readings} readings of {imported.duration_s:.1f} s{commands}")
    print(f"attitude {imported.attitude}; motion of the base {motion}")
    return 0


@log.command
def plot(file: Path, /, *, out: OptionalPath = None, robot: RobotOfLog = None) -> int:
    """Plot a log on one HTML page: joints, torques, heat, contacts, paths of the feet, timing, faults.

    Parameters
    ----------
    file
        The log.
    out
        Page to write (default: FILE.html, in the same folder).
    robot
        Name of a robot, or a folder with its robot.yaml (default: the log's robot).
    """
    from footfall.evaluate.report.extra import check_installed

    page = _beside(file, ".html", out)
    check_outputs(page, inputs=[file])
    check_installed()
    findings = findings_of(file, robot)
    from footfall.common.outputs import write_text
    from footfall.evaluate.report.log_page import render

    write_text(page, render(findings, headline(findings)))
    print(f"{page}: {' '.join(findings.verdicts())}")
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
        Seconds from the log's start (default: the log's end).
    out
        Copy to write (default: FILE.cut.mcap, in the same folder).
    """
    if not 0.0 <= start < end:
        raise UserError(
            f"from {start:g} to {end:g} s is not a time range: give --from of at least 0 s, and below --to"
        )
    part = _beside(file, f".cut{file.suffix}", out)
    check_outputs(part, inputs=[file])
    from footfall.deploy.recover import cut as cut_log

    copied = cut_log(file, part, start, end)
    print(f"{copied.messages} messages in {part}{_damage_note(copied.damaged)}")
    return 0


@log.command
def frames(file: Path, /, *, out: OptionalPath = None) -> int:
    """Write a log's CAN frames in the format of candump; `footfall deploy --log-frames` records them.

    Parameters
    ----------
    file
        The log.
    out
        Text file to write (default: standard output).
    """
    check_outputs(out, inputs=[file])
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
    """Write a layout for a log viewer, with plots for the joints of the log.

    Parameters
    ----------
    file
        The log, or another log of the same robot.
    tool
        foxglove (Lichtblick can import it, too) or plotjuggler.
    out
        File to write (default: ROBOT.foxglove.json or ROBOT.plotjuggler.xml, in the log's folder).
    """
    from footfall.common.outputs import write_text
    from footfall.deploy.log_analysis.layouts import LAYOUTS
    from footfall.deploy.log_file import read_log

    header = read_log(file, topics=())
    make, suffix = LAYOUTS[tool]
    robot = Path(header.text("robot")).name  # a log of another maker may name any path
    target = file.parent / f"{robot}.{tool}{suffix}" if out is None else out
    check_outputs(target, inputs=[file])
    write_text(target, make(header.joints))
    print(f"{target}: import it in {tool}")
    return 0


@log.command
def recover(file: Path, /, *, out: OptionalPath = None) -> int:
    """Repair a truncated or damaged log, so that tools can open it that need its index.

    Parameters
    ----------
    file
        The log.
    out
        Repaired copy to write (default: FILE.recovered.mcap, in the same folder).
    """
    target = _beside(file, f".recovered{file.suffix}", out)
    check_outputs(target, inputs=[file])
    from footfall.deploy.recover import recover as recover_log

    recovered = recover_log(file, target)
    print(f"{recovered.messages} messages in {target}{_damage_note(recovered.damaged)}")
    return 0


def _beside(file: Path, suffix: str, out: Path | None) -> Path:
    """The given output, or one with another suffix in the folder of the input."""
    return file.parent / f"{file.stem}{suffix}" if out is None else out


def _damage_note(damaged: int) -> str:
    return f", {damaged} damaged parts skipped" if damaged else ""
