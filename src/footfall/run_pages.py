"""Web pages during a run: a 3-D view, and a cockpit that can steer the robot."""

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

TIMED_STEPS = 500  # number of latest ticks and policy steps in the cockpit's timing
WAITING = "the robot stands up once an operator has taken control there"


@Parameter(name="*")
@dataclass(frozen=True)
class RunPageOptions:
    """Web pages for the run. With any of them it runs in real time."""

    view: bool = False
    """Show the robot in 3-D, with footholds, forces and balance (see docs/cockpit.md)."""
    cockpit: bool = False
    """Serve a web page that shows and stops the run, and steers it without --command or a mission."""
    foxglove: bool = False
    """Serve the run, read-only, to Foxglove, Lichtblick and PlotJuggler (see docs/logs.md)."""
    ros2: bool = False
    """Publish the run to ROS 2, independently of the steering (see docs/ros2.md)."""
    page_host: str = "localhost"
    """Host name or address of the server; 0.0.0.0 allows connections from other machines."""
    view_port: Port = 8080
    cockpit_port: Port = 8090
    foxglove_port: Port = 8765


NO_PAGES = RunPageOptions()


def inbox_of(options: RunPageOptions) -> "Inbox | None":
    """Inbox for a cockpit; None without one."""
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
    """Serve the pages while the context is open. If a cockpit steers, wait for an operator first.

    Args:
        options: pages and addresses.
        robot: robot of the run.
        feed: socket of an existing feed; None: the pages get their own.
        steering: steering of the run.
        inbox: see `inbox_of`.

    Yields:
        The steering of the run with these pages, and the socket of their feed.

    Raises:
        UserError: an extra is not installed, or an address is not available.
    """
    with ExitStack() as resources:
        if options.view or options.cockpit or options.foxglove or options.ros2:
            feed = feed or Path(resources.enter_context(TemporaryDirectory(prefix="footfall-"))) / "feed"
            steering = steering._replace(realtime=True, odometry=True)
        if options.view and feed is not None:
            from footfall.pages.run_page import viewed

            address = resources.enter_context(viewed(robot, feed, options.page_host, options.view_port))
            print(f"3-D view: {address}", flush=True)
        if options.foxglove and feed is not None:
            from footfall.operate.foxglove import foxglove_served

            address = resources.enter_context(foxglove_served(feed, options.page_host, options.foxglove_port))
            print(f"for Foxglove: {address}", flush=True)
        if options.ros2 and steering.feed is None and feed is not None:  # a steering ROS has it
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
    """Serve the cockpit. It steers a run whose source is the inbox; any other run it shows and may stop."""
    from footfall.operate.accompanied import Accompanied
    from footfall.pages.cockpit.beside import cockpit

    steers, loops = steering.source is inbox, list["ControlLoop"]()

    def extra_state() -> dict[str, Any]:
        state: dict[str, Any] = {"robot": robot.name, "steers": steers, "mission": steering.line() or None}
        if loops:
            state["timing"] = loops[0].timing.summary(TIMED_STEPS)
        return state

    served = cockpit(inbox, options.page_host, options.cockpit_port, robot, feed, extra_state)
    link, address = resources.enter_context(served)
    print(f"cockpit: {address}", flush=True)
    if not steers:
        return steering._replace(source=Accompanied(steering.source, inbox), attach=loops.append)
    if not steering.about:  # no other operator may steer
        print(WAITING, flush=True)
        link.wait_until_steered()
    return steering._replace(attach=loops.append)
