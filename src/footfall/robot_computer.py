"""Checks of a robot's computer for `footfall doctor`, one finding each.

Checks that read kernel files take the folder that replaces `/`.
"""

import importlib.util
import json
import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from footfall.common.installation import install_command
from footfall.common.processors import usable_cores
from footfall.deploy.clock import may_lock_memory
from footfall.deploy.frames import BITRATE
from footfall.deploy.python_can_bus import MULTICAST_GROUP
from footfall.finding import Finding

ROOT = Path("/")
CAN_LINK_TYPE = "280"  # ARPHRD_CAN
MIN_CAN_QUEUE = 64  # frames; the kernel's default of 10 is less than the frames of one tick on a full bus
CLOCK_PROGRAMS = ("chronyd", "ntpd", "ptp4l", "systemd-timesyn")  # names as truncated in /proc
TIME_ERROR = 5  # adjtimex: no program disciplines the clock
LIMITS = "/etc/security/limits.d/robot.conf"
PROBE_LIMIT_S = 10


def check_processors(root: Path = ROOT) -> Finding:
    """Number of usable cores, and their power governor."""
    usable, cores = usable_cores(), root / "sys/devices/system/cpu"
    governors = {_read(file) for file in cores.glob("cpu[0-9]*/cpufreq/scaling_governor")}
    found = f"{usable} usable" + (f", governor {', '.join(sorted(governors))}" if governors else "")
    slow = bool(governors - {"performance"})
    advice = "for wall-clock runs: cpupower frequency-set -g performance" if slow else ""
    return Finding("processors", not slow, found, advice)


def check_isolated_cores(root: Path = ROOT) -> Finding:
    """Whether a core is isolated from other programs."""
    cores = _read(root / "sys/devices/system/cpu/isolated")
    last = (os.cpu_count() or 1) - 1
    advice = (
        f"a real robot's loop benefits from its own core: isolcpus={last} nohz_full={last} rcu_nocbs={last}"
        f" in the kernel's command line, CPUAffinity={last} in the service (docs/service.md)"
    )
    return Finding("isolated cores", bool(cores), cores or "none", "" if cores else advice)


def check_kernel(root: Path = ROOT) -> Finding:
    """Whether the kernel is a real-time kernel."""
    version = _read(root / "proc/version")
    good = "PREEMPT_RT" in version or _read(root / "sys/kernel/realtime") == "1"
    name = version.split()[2] if len(version.split()) > 2 else sys.platform
    advice = "it reduces the lateness of a real robot's loop: apt install linux-image-rt-amd64 (Debian)"
    found = f"{name}, {'PREEMPT_RT' if good else 'not a real-time kernel'}"
    return Finding("kernel", good, found, "" if good else advice)


def check_clock(root: Path = ROOT, synchronised: Callable[[], bool] | None = None) -> Finding:
    """Whether a program disciplines the clock."""
    names = {_read(file) for file in root.glob("proc/[0-9]*/comm")}
    running = ", ".join(sorted(names.intersection(CLOCK_PROGRAMS)))
    good = (synchronised or clock_is_synchronised)()
    found = ("synchronised" if good else "not synchronised") + (f" by {running}" if running else "")
    wait = "wait for it: chronyc tracking, or timedatectl" if running else "apt install chrony"
    advice = "" if good else f"needed only for logs from several computers: {wait}"
    if not good and any(root.glob("sys/class/ptp/ptp*")):
        advice += "; below 1 ms: ptp4l and phc2sys (linuxptp), this network card has a PTP clock"
    return Finding("clock", good, found, advice)


def clock_is_synchronised() -> bool:
    """Whether the kernel's clock is disciplined by a program."""
    import ctypes

    try:
        state: int = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(512))  # changes nothing
    except AttributeError:  # not Linux
        return False
    return state not in (-1, TIME_ERROR)


def check_can(
    root: Path = ROOT,
    has_sockets: Callable[[], bool] | None = None,
    details: Callable[[], dict[str, Any]] | None = None,
) -> Finding:
    """CAN interfaces: state, bit rate and queue, with commands to correct them."""
    links = [path for path in sorted(root.glob("sys/class/net/*")) if _read(path / "type") == CAN_LINK_TYPE]
    if not links:
        socket_missing = (
            "" if (has_sockets or has_can_sockets)() else ", and this system's kernel has no CAN sockets"
        )
        advice = "needed only for a real robot, not for --bus sim"
        if socket_missing and sys.platform == "linux":
            advice += "; with an adapter: modprobe can_raw"
        return Finding("CAN interfaces", False, f"none{socket_missing}", advice)
    details_by_name = (details or can_details)()
    described, commands = [], list[str]()
    for link in links:
        is_down = _read(link / "operstate") == "down"
        link_details = details_by_name.get(link.name, {})
        described.append(link.name + "".join(f" ({what})" for what in _can_state(is_down, link_details)))
        commands += _can_commands(link.name, is_down, link_details, int(_read(link / "tx_queue_len") or 0))
    return Finding("CAN interfaces", not commands, ", ".join(described), "; ".join(commands))


def _can_state(is_down: bool, link_details: dict[str, Any]) -> Iterator[str]:
    if is_down:
        yield "down"
        return
    if rate := link_details.get("bittiming", {}).get("bitrate"):
        yield f"{rate / 1000:g} kbit/s"
    if (state := link_details.get("state", "ERROR-ACTIVE")) != "ERROR-ACTIVE":
        yield state.lower()


def _can_commands(name: str, is_down: bool, link_details: dict[str, Any], queue: int) -> Iterator[str]:
    """Commands that correct an interface."""
    up = f"ip link set {name} up type can bitrate {BITRATE} restart-ms 100"
    if is_down:
        yield up
    elif link_details.get("bittiming", {}).get("bitrate", BITRATE) != BITRATE:
        yield f"ip link set {name} down"
        yield up
    elif link_details.get("state") == "BUS-OFF":
        yield f"ip link set {name} type can restart"
    elif link_details.get("state", "ERROR-ACTIVE") != "ERROR-ACTIVE":
        yield f"{name} sees errors: check 120 ohm at both ends of its bus, and one bit rate for all nodes"
    if 0 < queue < MIN_CAN_QUEUE:
        yield f"ip link set {name} txqueuelen {MIN_CAN_QUEUE}"


def can_details() -> dict[str, Any]:
    """Kernel information on each CAN controller, by interface; empty if `ip` has none."""
    if shutil.which("ip") is None:
        return {}
    command = ["ip", "-details", "-json", "link", "show", "type", "can"]
    try:
        process = subprocess.run(command, capture_output=True, text=True, timeout=PROBE_LIMIT_S, check=False)
        links = json.loads(process.stdout or "[]")
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return {}
    return {link["ifname"]: link.get("linkinfo", {}).get("info_data", {}) for link in links if link}


def has_can_sockets() -> bool:
    """Whether the kernel has the CAN protocol family."""
    if not hasattr(socket, "AF_CAN"):
        return False
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError:
        return False
    return True


def check_multicast() -> Finding:
    """Whether a simulated robot in another process can be reached (udp_multicast)."""
    name, membership = "multicast", socket.inet_aton(MULTICAST_GROUP) + socket.inet_aton("0.0.0.0")
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
            receiver.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    except OSError as error:
        advice = "--bus udp_multicast, a simulated robot in another process, needs a network with multicast"
        return Finding(name, False, f"no: {error.strerror or error}", advice)
    if importlib.util.find_spec("msgpack") is None:
        return Finding(
            name, False, "no msgpack", f"--bus udp_multicast needs it: {install_command('msgpack')}"
        )
    return Finding(name, True, "works")


def check_realtime() -> Finding:
    """Whether threads may have a real-time priority."""
    allowed = False
    if hasattr(os, "sched_setscheduler"):
        child = os.fork()
        if child == 0:  # a child process tries it, so that this process keeps its scheduling
            try:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
            except OSError:
                os._exit(1)
            os._exit(0)
        allowed = os.waitpid(child, 0)[1] == 0
    return Finding(
        "real-time scheduling",
        allowed,
        "permitted" if allowed else "not permitted",
        "" if allowed else f"needed on a real robot only: 'robot - rtprio 90' in {LIMITS} for user robot",
    )


def check_locked_memory() -> Finding:
    """Whether the loop may lock its memory against paging."""
    good = may_lock_memory()
    advice = f"needed on a real robot only: 'robot - memlock unlimited' in {LIMITS} for user robot"
    return Finding("memory locking", good, "permitted" if good else "not permitted", "" if good else advice)


def _read(path: Path) -> str:
    """Content of a kernel file; empty if it cannot be read."""
    try:
        return path.read_text().strip()
    except OSError:
        return ""


ROBOT_COMPUTER: tuple[Callable[[], Finding], ...] = (
    check_processors,
    check_isolated_cores,
    check_kernel,
    check_clock,
    check_can,
    check_multicast,
    check_realtime,
    check_locked_memory,
)
