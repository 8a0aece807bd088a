"""Command-line arguments of a bridge process. Uses only the standard library."""

import argparse
from collections.abc import Sequence
from typing import NamedTuple

READY = "ready"  # line that a bridge prints once its topics are advertised


class BridgeArguments(NamedTuple):
    """Arguments of a bridge."""

    feed: str  # socket of the run's telemetry; it may be created later
    steer: str | None  # socket for commands; None to publish only
    stamped: bool  # velocities are TwistStamped
    child: bool  # the bridge ends with its standard input


def parse(program: str, arguments: Sequence[str]) -> tuple[BridgeArguments, list[str]]:
    """Parse a bridge's arguments; returns them and those for ROS."""
    parser = argparse.ArgumentParser(prog=program)
    parser.add_argument("--feed", required=True)
    parser.add_argument("--steer")
    parser.add_argument("--cmd-vel", choices=("twist", "stamped"), default="twist")
    parser.add_argument("--child", action="store_true")
    found, rest = parser.parse_known_args(arguments)
    return BridgeArguments(found.feed, found.steer, found.cmd_vel == "stamped", found.child), rest
