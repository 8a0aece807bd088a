"""A command source that is open."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from footfall.deploy.command_source import CommandSource


class Opened(NamedTuple):
    """A command source, and what its operator reads."""

    source: CommandSource
    line: Callable[[], str]  # its state, for a status line
    about: tuple[str, ...] = ()  # lines for the operator before the run begins
    odometry: bool = False  # whether it tells the operator where the robot is
    feed: Path | None = None  # socket at which it expects the run's telemetry
