"""Steering of a run: by a fixed command, a mission or an operator."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.common.limits import MAX_DURATION_S
from footfall.deploy.command_source import CommandSource, Scheduled
from footfall.policies.policy import Policy
from footfall.robots.description import Robot

if TYPE_CHECKING:
    from footfall.deploy.loop import ControlLoop
    from footfall.operate.inbox import Inbox
    from footfall.operate.missions.source import MissionSource

COCKPIT = "cockpit"
DEFAULT_COMMAND, DEFAULT_S = (0.5, 0.0, 0.0), 10.0


class Steered(NamedTuple):
    """Steering of a run."""

    source: CommandSource
    duration_s: float  # longest walking time
    figures: Callable[[], dict[str, Any]]  # entries for the report
    line: Callable[[], str] = str  # line for the live state
    about: tuple[str, ...] = ()  # lines for the operator before the run
    realtime: bool = False  # an operator steers
    odometry: bool = False  # the source needs the pose
    attach: "Callable[[ControlLoop], None]" = lambda _: None  # gives pages the loop whose timing they show
    feed: Path | None = None  # socket at which the source expects the run's telemetry
    failed: Callable[[], bool] = bool  # whether the source, such as a mission, missed its goal


def mission_policies(source_name: str | None, loaded: Sequence[Policy], robot: Robot) -> dict[str, Policy]:
    """Policies in a mission that are not loaded yet, by spec.

    Raises:
        UserError: the file is not a mission, or names an unknown policy.
    """
    from footfall.operate.sources import is_mission

    if source_name is None or not is_mission(source_name):
        return {}
    from footfall.operate.missions.mission import load_mission
    from footfall.operate.missions.run import policies_of

    return policies_of(load_mission(Path(source_name)), [policy.name for policy in loaded], robot)


@contextmanager
def steered(
    source_name: str | None,
    command: tuple[float, float, float] | None,
    duration_s: float | None,
    policies: Mapping[str, Policy],
    robot: Robot,
    inbox: "Inbox | None" = None,
) -> Iterator[Steered]:
    """Open the command source of a run.

    Args:
        source_name: name of a source, or the file of a mission; None for a fixed command.
        command: fixed command (3,).
        duration_s: longest walking time; default ten seconds, or one day if the source ends the run.
        policies: policies of the run by spec, starting with the first to run.
        robot: robot of the run.
        inbox: inbox of a cockpit, which steers if nothing else does; None without a cockpit.

    Raises:
        UserError: there is no such source, it cannot be opened, or a step of the mission is impossible.
    """
    longest_s = duration_s or MAX_DURATION_S
    if source_name is None and command is None and inbox is not None:
        figures = {"from": COCKPIT}
        yield Steered(inbox, longest_s, lambda: figures, realtime=True, odometry=True)
        return
    if source_name is None:
        fixed = command or DEFAULT_COMMAND
        velocity = np.array(fixed)
        yield Steered(
            Scheduled(lambda _: velocity), duration_s or DEFAULT_S, lambda: {"command": list(fixed)}
        )
        return
    if command is not None:
        raise UserError("--command and --from exclude each other: give one of them")
    from footfall.operate.abilities import abilities_of
    from footfall.operate.inbox import Inbox
    from footfall.operate.sources import check_source, is_mission, open_source

    check_source(source_name)
    abilities = abilities_of(policies, robot)
    if is_mission(source_name):
        from footfall.operate.missions.mission import load_mission
        from footfall.operate.missions.source import MissionSource

        first = next(iter(policies.values()))
        source = MissionSource(load_mission(Path(source_name)), first.name, abilities)
        yield _mission(source_name, source, longest_s)
        return
    with open_source(source_name, inbox or Inbox(), abilities) as opened:
        yield Steered(
            opened.source,
            longest_s,
            lambda: {"from": source_name},
            opened.line,
            opened.about,
            realtime=True,
            odometry=opened.odometry,
            feed=opened.feed,
        )


def _mission(source_name: str, source: "MissionSource", longest_s: float) -> Steered:
    def line() -> str:
        progress = source.progress
        return f"step {progress.step} of {progress.steps} {progress.kind}, {progress.remaining_s:.0f} s left"

    def figures() -> dict[str, Any]:
        return {"from": source_name, "mission": source.progress._asdict()}

    return Steered(source, longest_s, figures, line, odometry=True, failed=lambda: not source.progress.done)
