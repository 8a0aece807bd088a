"""The cockpit's page, served by a separate process beside the control loop."""

import asyncio
import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from footfall.common.errors import UserError
from footfall.common.installation import needs_extra
from footfall.operate.cockpit_link import CockpitLink
from footfall.operate.inbox import Inbox
from footfall.pages.cockpit.access import Access
from footfall.pages.cockpit.joints import JointNames, joint_figures
from footfall.pages.cockpit.server import Cockpit
from footfall.pages.page import check_address
from footfall.pages.run_feed import RunFeed
from footfall.robots.description import Robot

START_TIMEOUT_S = 30.0
NICENESS = 5


@contextmanager
def cockpit(
    inbox: Inbox,
    host: str,
    port: int,
    robot: Robot,
    feed: Path,
    extra_state: Callable[[], Mapping[str, Any]] = dict,
) -> Iterator[tuple[CockpitLink, str]]:
    """Serve the page while the context lasts; yields the link to it and the address to open.

    Args:
        inbox: takes the page's commands.
        host, port: where to listen.
        robot: the robot.
        feed: socket of the run's feed.
        extra_state: further facts about the run, for JSON.

    Raises:
        UserError: websockets is not installed, or the address is not available.
    """
    with needs_extra("cockpit", "the cockpit needs"):
        import websockets  # noqa: F401
    check_address(host, port)
    access = Access(host, port)
    spawn = multiprocessing.get_context("spawn")
    own_end, child_end = spawn.Pipe()
    joints = JointNames(robot.joint_names, robot.motor.peak_torque.tolist())
    arguments = child_end, host, port, access.token, feed, joints
    process = spawn.Process(target=_serve, args=arguments, name="cockpit", daemon=True)
    process.start()
    child_end.close()
    try:
        if not own_end.poll(START_TIMEOUT_S) or "serving" not in _first_message(own_end):
            raise UserError(f"the cockpit at {host}:{port} did not start")
        link = CockpitLink(inbox, own_end, extra_state)
        try:
            yield link, f"http://{_url_host(host)}:{port}/?token={access.token}"
        finally:
            link.close()
    finally:
        process.join(1.0)
        process.terminate()
        process.join()
        own_end.close()


def _first_message(connection: Connection) -> dict[str, Any]:
    try:
        return dict(json.loads(connection.recv_bytes()))
    except EOFError:
        return {}


def _url_host(host: str) -> str:
    return f"[{host}]" if ":" in host else host


def _serve(link: Connection, host: str, port: int, token: str, feed: Path, joints: JointNames) -> None:
    """In the other process: serve until the loop's process ends the link or is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the loop, which then ends the link
    os.nice(NICENESS)
    extra_state = partial(joint_figures, RunFeed(feed), joints)
    asyncio.run(Cockpit(Access(host, port, token), link, extra_state).serve(host, port))
