"""Web pages beside a run: a 3-D view, and a cockpit from which the robot is steered."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from footfall.options import Port

if TYPE_CHECKING:
    from footfall.deploy.loop import ControlLoop
    from footfall.operate.inbox import Inbox
    from footfall.robots.description import Robot
    from footfall.steered import Steered

TIMED = 500  # latest ticks and policy steps whose timing the cockpit shows
WAITING = "the robot stands up once somebody has taken control there"


@Parameter(name="*")
@dataclass(frozen=True)
class RunPageOptions:
    """Web pages about the run. With one of them it keeps to the wall clock."""

    view: bool = False
    """Show the robot in 3-D, with footholds, forces and balance (see docs/cockpit.md)."""
    cockpit: bool = False
    """Serve a web page that shows and stops the run, and steers it unless --command or a mission does."""
    foxglove: bool = False
    """Serve the run, read-only, to Foxglove, Lichtblick and PlotJuggler (see docs/logs.md)."""
    ros2: bool = False
    """Publish the run to ROS 2, whoever steers it (see docs/ros2.md)."""
    page_host: str = "localhost"
    """Name or address to listen at; 0.0.0.0 lets other machines connect."""
    view_port: Port = 8080
    cockpit_port: Port = 8090
    foxglove_port: Port = 8765


NO_PAGES = RunPageOptions()


def inbox_of(options: RunPageOptions) -> "Inbox | None":
    """What a cockpit writes to; None without one."""
    if not options.cockpit:
        return None
    from footfall.operate.inbox import Inbox

    return Inbox()


@contextmanager
def run_pages(
    options: RunPageOptions,
    robot: "Robot",
    feed: Path | None,
    steering: "Steered",
    inbox: "Inbox | None",
) -> Iterator[tuple["Steered", Path | None]]:
    """Serve the pages for as long as the context lasts. Where a cockpit steers, wait for somebody at it.

    Args:
        options: which pages, and where.
        robot: that runs.
        feed: socket of a feed that is served anyway; None for one of the pages' own.
        steering: how the run is steered.
        inbox: see `inbox_of`.

    Yields:
        How the run is steered with these pages, and the socket of the feed that they read.

    Raises:
        UserError: an extra is not installed, or an address cannot be had.
    """
    with ExitStack() as resources:
        if options.view or options.cockpit or options.foxglove or options.ros2:
            feed = feed or Path(resources.enter_context(TemporaryDirectory(prefix="footfall-"))) / "feed"
            steering = steering._replace(realtime=True, odometry=True)
        if options.view and feed is not None:
            from footfall.pages.run_page import viewed

            address = resources.enter_context(viewed(robot, feed, options.page_host, options.view_port))
            print(f"the robot is shown at {address}", flush=True)
        if options.foxglove and feed is not None:
            from footfall.operate.foxglove import foxglove_served

            address = resources.enter_context(foxglove_served(feed, options.page_host, options.foxglove_port))
            print(f"Foxglove opens {address}", flush=True)
        if options.ros2 and steering.feed is None and feed is not None:  # else ROS steers, and has it
            from footfall.operate.ros2.run import published_to_ros2

            for line in resources.enter_context(published_to_ros2(feed)):
                print(line, flush=True)
        if inbox is not None and feed is not None:
            steering = _with_cockpit(options, robot, feed, steering, inbox, resources)
        yield steering, feed


def _with_cockpit(
    options: RunPageOptions,
    robot: "Robot",
    feed: Path,
    steering: "Steered",
    inbox: "Inbox",
    resources: ExitStack,
) -> "Steered":
    """Serve the cockpit. It steers a run whose source is the inbox; any other one it shows and may stop."""
    from footfall.operate.accompanied import Accompanied
    from footfall.pages.cockpit.beside import cockpit

    steers, loops = steering.source is inbox, list["ControlLoop"]()

    def more() -> dict[str, Any]:
        found: dict[str, Any] = {"robot": robot.name, "steers": steers, "mission": steering.line() or None}
        if loops:
            skipped = {"ticks_skipped": loops[0].ticks_skipped}
            found["timing"] = loops[0].timing.summary(TIMED) | skipped
        return found

    served = cockpit(inbox, options.page_host, options.cockpit_port, robot, feed, more)
    link, address = resources.enter_context(served)
    print(f"the cockpit is at {address}", flush=True)
    if not steers:
        return steering._replace(source=Accompanied(steering.source, inbox), attach=loops.append)
    if not steering.about:  # nobody else may steer
        print(WAITING, flush=True)
        link.wait_until_steered()
    return steering._replace(attach=loops.append)
