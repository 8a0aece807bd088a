"""`footfall demo`."""

import subprocess
import sys
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from cyclopts import Parameter

from footfall.common.errors import UserError
from footfall.options import Count, Names, OptionalPath, RobotName, Seed
from footfall.robots.default import DEFAULT_ROBOT

FELL = 1  # exit status of deploy after a fall; the demo continues and exits with it


@Parameter(name="*")
@dataclass(frozen=True)
class DemoOptions:
    """Settings of the demo."""

    robot: RobotName = DEFAULT_ROBOT
    preset: str = "cpu"
    """Training preset, by name or YAML file."""
    seed: Seed = 0
    out: OptionalPath = None
    """Folder for all files of the demo (default: runs/demo-TIME)."""
    scenarios: Names = ("gentle", "push")
    """Scenarios of the comparison."""
    episodes: Count = 8
    """Episodes per scenario."""


def demo(*, options: DemoOptions = DemoOptions()) -> int:
    """Train for a few minutes, run the policy over CAN, and compare it with other policies in a report.
    Exit 1 if the robot fell in the run.
    """
    from footfall.evaluate.report.extra import check_display, check_installed
    from footfall.evaluate.scenarios import load_scenarios
    from footfall.policies.registry import first_of_each_kind, walking_controllers, zoo_names
    from footfall.robots.description import load_robot
    from footfall.train.config import load_preset

    robot = load_robot(options.robot)
    load_preset(options.preset, robot)
    load_scenarios(robot).select(options.scenarios)  # finds errors of the last step first
    check_installed()
    check_display()
    folder = options.out or Path("runs") / f"demo-{datetime.now():%Y%m%d-%H%M%S}"
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} exists and is not empty: give another --out")
    run, report = folder / "trained", folder / "report.html"
    # The first zoo policy is for flat ground, as in the comparison: NAME-flat sorts before NAME-rough.
    others = [*zoo_names(robot)[:1], *first_of_each_kind(walking_controllers(robot))]
    command = f"{0.5 * robot.description.commands.forward_m_s[1]:g},0,0"
    shared = ["--robot", options.robot, "--seed", str(options.seed)]
    _step("train", *shared, "--no-evaluate", "--preset", options.preset, "--out", str(run))
    _step("export", str(run), "--out", str(folder / "policy.onnx"))
    status = _step(
        *("deploy", str(run), *shared, "--command", command, "--duration", "10"),
        *("--log", str(folder / "walk.mcap"), "--json", str(folder / "walk.json")),
        tolerated=(FELL,),
    )
    _step(
        *("compare", str(run), *others, *shared),
        *("--scenarios", ",".join(options.scenarios), "--episodes", str(options.episodes)),
        *("--json", str(folder / "compare.json"), "--html", str(report)),
    )
    print(f"\nthe report is at {report.resolve()}")
    return status


def _step(*tokens: str, tolerated: tuple[int, ...] = ()) -> int:
    """Run one command as a user would type it, in a separate process; returns its exit status.

    Raises:
        UserError: the status is neither 0 nor tolerated; this ends the demo.
    """
    print(f"\n$ footfall {' '.join(tokens)}", flush=True)
    process = subprocess.Popen([sys.executable, "-P", "-m", "footfall", *tokens])
    try:
        status = process.wait()
    except KeyboardInterrupt:
        process.wait()  # Ctrl-C reached it, too: wait for an orderly end
        raise
    if status != 0 and status not in tolerated:
        raise UserError(f"footfall {tokens[0]} failed with status {status}; its message is above")
    return status
