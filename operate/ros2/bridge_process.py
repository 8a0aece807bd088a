"""Starts the ROS 2 process: with the robot's own ROS Python, or with cyclonedds if there is no ROS."""

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
from footfall.common.child_process import end_by_closing_input
from footfall.common.config import require_between
from footfall.common.errors import UserError
from footfall.common.installation import extras_command
from footfall.operate.ros2.arguments import READY
from footfall.operate.udp_client import TOKEN

RCLPY, CYCLONE = "footfall.operate.ros2.rclpy_bridge", "footfall.operate.ros2.cyclone_bridge"
PROBE_S, START_S, END_S = 20.0, 30.0, 3.0  # maximum waits
SYSTEM_PYTHON = "/usr/bin/python3"
DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
SEE_AND_CONTROL = "see and control this robot"


@dataclass(frozen=True)
class Ros2Config:
    """Settings of a run's connection to ROS 2."""

    cmd_vel: Literal["twist", "stamped"] = "twist"  # message type: Twist or TwistStamped
    python: str = ""  # path of a Python interpreter with rclpy; empty to search for one
    arguments: tuple[str, ...] = ()  # ROS arguments, such as -r __ns:=/robot
    lie_down_after_s: float = 10.0  # time without any message; Nav2 is silent between two goals

    def __post_init__(self) -> None:
        require_between(self, 0.5, 3600.0, "lie_down_after_s")


@dataclass(frozen=True)
class Backend:
    """Implementation of the ROS 2 connection."""

    python: str
    module: str
    about: str  # one line for the user


def find_backend(config: Ros2Config) -> Backend:
    """The back end available on this computer.

    Raises:
        UserError: there is none, or the configured Python has no rclpy.
    """
    if python := config.python:
        if not _has_rclpy(python):
            raise UserError(f"python: {python} cannot import rclpy: source ROS 2, or choose another one")
        return Backend(python, RCLPY, f"ROS 2 by rclpy of {python}")
    for python in (sys.executable, SYSTEM_PYTHON):
        if _has_rclpy(python):
            return Backend(python, RCLPY, f"ROS 2 by rclpy of {python}")
    if find_spec("cyclonedds") is None:
        raise UserError(
            "no ROS 2 found: source its setup.bash, choose a Python with rclpy in a YAML file for"
            f" --from ros2:FILE, or use topics only: {extras_command('ros2')}"
        )
    if config.arguments:
        raise UserError("arguments: cyclonedds accepts no ROS arguments: source ROS 2, or omit them")
    about = "ROS 2 by cyclonedds: topics only; services, parameters and actions need rclpy"
    return Backend(sys.executable, CYCLONE, about)


def _has_rclpy(python: str) -> bool:
    command = [python, "-c", "import rclpy, rcl_interfaces.msg"]
    try:
        return not subprocess.run(command, capture_output=True, timeout=PROBE_S, check=False).returncode
    except (OSError, subprocess.TimeoutExpired):
        return False


def network_note(access: str = SEE_AND_CONTROL, environment: Mapping[str, str] = os.environ) -> str:
    """Warning that other computers have this access, if the environment opens ROS to the network.

    Returns:
        One line; empty if ROS is not open to the network.
    """
    requested = environment.get(DISCOVERY_RANGE, "LOCALHOST").upper()
    if requested in ("LOCALHOST", "OFF"):
        return ""
    return f"{DISCOVERY_RANGE} is {requested}: other computers can {access}: DDS has no password"


@contextmanager
def bridge(backend: Backend, feed: Path, steer: Path | None, config: Ros2Config) -> Iterator[None]:
    """Run the bridge while the context is open.

    Args:
        backend: see `find_backend`.
        feed: socket of the run's telemetry; it may be created later.
        steer: socket for commands; None to publish only.
        config: settings of the connection.

    Raises:
        UserError: it does not start.
    """
    arguments = ["--feed", str(feed), "--child", "--cmd-vel", config.cmd_vel]
    arguments += [] if steer is None else ["--steer", str(steer)]
    with _running(backend, backend.module, arguments, config):
        yield


@contextmanager
def scan_bridge(backend: Backend, port: int, token: str, config: Ros2Config) -> Iterator[None]:
    """Run a separate bridge for height scans while the context is open: it forwards them by UDP.

    Args:
        backend: see `find_backend`.
        port: port of this computer on which `height_scan_udp.UdpScans` listens.
        token: token for these scans.
        config: settings of the connection.

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
    """Run a module with the back end's Python while the context is open.

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
        resources.callback(end_by_closing_input, process, END_S)
        assert process.stdout is not None
        start_timer = threading.Timer(START_S, process.kill)
        start_timer.start()
        answer = process.stdout.readline().strip()
        start_timer.cancel()
        if answer != READY.encode():
            process.wait(END_S)
            errors.seek(0)
            last = errors.read().decode(errors="replace").strip().splitlines()
            reason = last[-1] if last else "it printed no reason"
            raise UserError(f"the ROS 2 bridge does not start: {reason}")
        yield


def _environment(folder: Path) -> dict[str, str]:
    """Environment of the bridge: it can import footfall, but no other packages of this Python."""
    (folder / "footfall").symlink_to(Path(footfall.__file__).parent, target_is_directory=True)
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.setdefault(DISCOVERY_RANGE, "LOCALHOST")
    if environment.get("ROS_DISTRO") == "humble" and environment[DISCOVERY_RANGE] == "LOCALHOST":
        environment.setdefault("ROS_LOCALHOST_ONLY", "1")  # for releases without the variable above
    return environment
