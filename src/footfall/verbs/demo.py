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

FELL = 1  # deploy's exit status after a fall: the demo continues and exits with it


@Parameter(name="*")
@dataclass(frozen=True)
class DemoOptions:
    """Where and how to run the demo."""

    robot: RobotName = DEFAULT_ROBOT
    preset: str = "cpu"
    """How to train: a preset, or a YAML file of the same form."""
    seed: Seed = 0
    out: OptionalPath = None
    """Folder for everything that the demo makes (default: runs/demo-TIME)."""
    scenarios: Names = ("gentle", "push")
    """What to compare on."""
    episodes: Count = 8
    """Episodes of each scenario."""


def demo(*, options: DemoOptions = DemoOptions()) -> int:
    """Train for a few minutes, run the policy over CAN, compare it with the others: ends with a report.

    Exit 1 if the robot fell on the way.
    """
    from footfall.evaluate.report.extra import check_display, check_installed
    from footfall.evaluate.scenarios import load_scenarios
    from footfall.policies.registry import first_of_each_kind, walking_controllers, zoo_names
    from footfall.robots.description import load_robot
    from footfall.train.config import load_preset

    robot = load_robot(options.robot)
    load_preset(options.preset, robot)
    load_scenarios(robot).select(options.scenarios)  # errors of the last step are found before the first one
    check_installed()
    check_display()
    folder = options.out or Path("runs") / f"demo-{datetime.now():%Y%m%d-%H%M%S}"
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f"{folder} exists and is not empty: give another --out")
    run, report = folder / "trained", folder / "report.html"
    # The first is for the flat ground of the comparison: NAME-flat comes before NAME-rough.
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
    """Run one command as a user would type it, in a process of its own; returns its exit status.

    Raises:
        UserError: it is neither 0 nor tolerated, which ends the demo.
    """
    print(f"\n$ footfall {' '.join(tokens)}", flush=True)
    process = subprocess.Popen([sys.executable, "-P", "-m", "footfall", *tokens])
    try:
        status = process.wait()
    except KeyboardInterrupt:
        process.wait()  # Ctrl-C reached it too; let it end in an orderly way
        raise
    if status != 0 and status not in tolerated:
        raise UserError(f"footfall {tokens[0]} failed with status {status}; its message is above")
    return status
