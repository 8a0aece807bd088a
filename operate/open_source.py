"""A command source that is open."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from footfall.deploy.command_source import CommandSource


class OpenSource(NamedTuple):
    """A command source with information for its operator."""

    source: CommandSource
    line: Callable[[], str]  # returns its state for a status line
    about: tuple[str, ...] = ()  # lines for the operator before the start
    odometry: bool = False  # whether it reports the robot's position to the operator
    feed: Path | None = None  # socket on which it expects the run's telemetry
