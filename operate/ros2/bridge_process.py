"""Starts the process that speaks ROS 2: the robot's own ROS Python, or cyclonedds where there is no ROS."""

import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import footfall
from footfall.common.child_process import end_by_input
from footfall.common.config import require_between
from footfall.common.errors import UserError
from footfall.common.installation import install_extras
from footfall.operate.ros2.arguments import READY
from footfall.operate.udp_client import TOKEN

RCLPY, CYCLONE = "footfall.operate.ros2.rclpy_bridge", "footfall.operate.ros2.cyclone_bridge"
PROBE_S, START_S, END_S = 20.0, 30.0, 3.0  # patience
SYSTEM_PYTHON = "/usr/bin/python3"
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
OPEN_NETWORK = "{} is {}: other computers can {}: DDS asks nobody for a password"
STEER = "see and steer this robot"


@dataclass(frozen=True)
class Ros2Config:
    """How a run takes part in ROS 2."""

    cmd_vel: Literal["twist", "stamped"] = "twist"  # its type: Twist or TwistStamped
    python: str = ""  # that has rclpy; empty finds one
    arguments: tuple[str, ...] = ()  # of ROS, such as -r __ns:=/robot
    lie_down_after_s: float = 10.0  # without any message; Nav2 is silent between two goals

    def __post_init__(self) -> None:
        require_between(self, 0.5, 3600.0, "lie_down_after_s")


@dataclass(frozen=True)
class Backend:
    """What speaks ROS 2."""

    python: str
    module: str
    about: str  # one line for people


def find_backend(config: Ros2Config) -> Backend:
    """The back end that this computer has.

    Raises:
        UserError: it has none, or the Python that was named has no rclpy.
    """
    if python := config.python:
        if not _has_rclpy(python):
            raise UserError(f"python: {python} cannot import rclpy: source ROS 2, or name another one")
        return Backend(python, RCLPY, f"ROS 2 by rclpy of {python}")
    for python in (sys.executable, SYSTEM_PYTHON):
        if _has_rclpy(python):
            return Backend(python, RCLPY, f"ROS 2 by rclpy of {python}")
    if find_spec("cyclonedds") is None:
        raise UserError(
            "no ROS 2 is found here: source its setup.bash, name a Python that has rclpy in a YAML file for"
            f" --from ros2:FILE, or have topics alone: {install_extras('ros2')}"
        )
    if config.arguments:
        raise UserError("arguments: cyclonedds takes none of ROS: source ROS 2, or leave them out")
    about = "ROS 2 by cyclonedds: topics only; services, parameters and actions need rclpy"
    return Backend(sys.executable, CYCLONE, about)


def _has_rclpy(python: str) -> bool:
    command = [python, "-c", "import rclpy, rcl_interfaces.msg"]
    try:
        return not subprocess.run(command, capture_output=True, timeout=PROBE_S, check=False).returncode
    except (OSError, subprocess.TimeoutExpired):
        return False


def network_note(what: str = STEER, environment: Mapping[str, str] = os.environ) -> str:
    """A warning of what others can do if the environment opens ROS to the network; empty if it does not."""
    asked = environment.get(RANGE, "LOCALHOST").upper()
    return "" if asked in ("LOCALHOST", "OFF") else OPEN_NETWORK.format(RANGE, asked, what)


@contextmanager
def bridge(backend: Backend, feed: Path, steer: Path | None, config: Ros2Config) -> Iterator[None]:
    """Run the bridge for a while.

    Args:
        backend: see `find_backend`.
        feed: socket of the run's telemetry; it may come to be later.
        steer: socket that takes commands; None for a bridge that publishes only.
        config: of the run.

    Raises:
        UserError: it does not start.
    """
    arguments = ["--feed", str(feed), "--child", "--cmd-vel", config.cmd_vel]
    arguments += [] if steer is None else ["--steer", str(steer)]
    with _running(backend, backend.module, arguments, config):
        yield


@contextmanager
def scan_bridge(backend: Backend, port: int, token: str, config: Ros2Config) -> Iterator[None]:
    """Run a bridge of its own for height scans for a while: it sends them on by UDP.

    Args:
        backend: see `find_backend`.
        port: of this computer, where `height_scan_udp.UdpScans` listens.
        token: that it knows.
        config: of the run's part in ROS 2.

    Raises:
        UserError: it does not start.
    """
    with _running(backend, f"{backend.module}.height_scans", [str(port)], config, {TOKEN: token}):
        yield


@contextmanager
def _running(
    backend: Backend,
    module: str,
    arguments: Sequence[str],
    config: Ros2Config,
    secrets: Mapping[str, str] = MappingProxyType({}),
) -> Iterator[None]:
    """Run a module of the back end's Python until the context ends.

    Raises:
        UserError: it does not start.
    """
    command = [backend.python, "-m", module, *arguments]
    command += ["--ros-args", *config.arguments] if config.arguments else []
    with ExitStack() as resources:
        folder = Path(resources.enter_context(tempfile.TemporaryDirectory(prefix="footfall-ros2-")))
        errors = resources.enter_context((folder / "errors").open("w+b"))
        pipe, environment = subprocess.PIPE, {**_environment(folder), **secrets}
        process = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=errors, env=environment)
        resources.callback(end_by_input, process, END_S)
        assert process.stdout is not None
        patience = threading.Timer(START_S, process.kill)
        patience.start()
        answer = process.stdout.readline().strip()
        patience.cancel()
        if answer != READY.encode():
            process.wait(END_S)
            errors.seek(0)
            last = errors.read().decode(errors="replace").strip().splitlines()
            raise UserError(f"the ROS 2 bridge does not start: {last[-1] if last else 'it says nothing'}")
        yield


def _environment(folder: Path) -> dict[str, str]:
    """Of the bridge: it can import footfall, and nothing else of this Python's packages."""
    (folder / "footfall").symlink_to(Path(footfall.__file__).parent, target_is_directory=True)
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.setdefault(RANGE, "LOCALHOST")
    if environment.get("ROS_DISTRO") == "humble" and environment[RANGE] == "LOCALHOST":
        environment.setdefault("ROS_LOCALHOST_ONLY", "1")  # older than the variable above
    return environment
