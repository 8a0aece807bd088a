"""Findings about a log for `footfall log`, and a headline."""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from footfall.common.errors import UserError

if TYPE_CHECKING:
    from footfall.deploy.log_analysis.findings import LogFindings


def findings_of(file: Path, robot: str | None) -> "LogFindings":
    """Findings about a log. Those about feet require a description of its robot."""
    from footfall.deploy.log_analysis.columns import read_columns
    from footfall.deploy.log_analysis.findings import LogFindings
    from footfall.deploy.log_analysis.robot import check_joints, logged_robot
    from footfall.robots.description import load_robot

    columns = read_columns(file)
    logged = None
    if robot is not None:
        logged = load_robot(robot)
        check_joints(columns.log, logged)
    with suppress(UserError):
        logged = logged or logged_robot(columns.log)
    return LogFindings(columns, logged)


def headline(findings: "LogFindings") -> str:
    """Policy, robot, date and duration."""
    from datetime import UTC, datetime

    from footfall.deploy.clock import LOCKSTEP_START_NS

    columns = findings.columns
    metadata = columns.log.metadata
    simulated = columns.start_ns < LOCKSTEP_START_NS + 10**14  # a day of simulated time
    date = (
        ""
        if simulated
        else f" on {datetime.fromtimestamp(columns.start_ns * 1e-9, UTC):%Y-%m-%d %H:%M:%S} UTC"
    )
    walked = sum(end - start for start, end in findings.walking)
    policy, robot, bus = (str(metadata.get(key, "?")) for key in ("policy", "robot", "bus"))
    return f"{policy} on {robot}, bus {bus}{date}: {columns.duration_s:.1f} s, walking {walked:.1f} s."
