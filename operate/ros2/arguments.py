"""Arguments of a bridge process. Needs the standard library alone."""

import argparse
from collections.abc import Sequence
from typing import NamedTuple

READY = "ready"  # the line that a bridge prints once its topics are advertised


class BridgeArguments(NamedTuple):
    """What a bridge was started with."""

    feed: str  # socket of the run's telemetry; it may come to be later
    steer: str | None  # socket that takes commands; None publishes only
    stamped: bool  # velocities come as TwistStamped
    child: bool  # the end of the standard input ends the bridge


def parse(program: str, arguments: Sequence[str]) -> tuple[BridgeArguments, list[str]]:
    """A bridge's arguments, and those that are left for ROS."""
    parser = argparse.ArgumentParser(prog=program)
    parser.add_argument("--feed", required=True)
    parser.add_argument("--steer")
    parser.add_argument("--cmd-vel", choices=("twist", "stamped"), default="twist")
    parser.add_argument("--child", action="store_true")
    found, rest = parser.parse_known_args(arguments)
    return BridgeArguments(found.feed, found.steer, found.cmd_vel == "stamped", found.child), rest
