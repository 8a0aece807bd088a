"""What this machine can do, one finding at a time, for `footfall doctor`."""

import ctypes
import importlib.util
import json
import os
import platform
import resource
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement

from footfall.common.cache import compilation_cache
from footfall.common.installation import extras, install, install_extras, missing
from footfall.common.processors import usable_cores

PROCESSORS = Path("/sys/devices/system/cpu")
PROBE_LIMIT_S = 60
MIN_LOCKED_MEMORY = 256 * 2**20
FOR_DEVELOPERS = ("dev",)
NETWORK = Path("/sys/class/net")
CAN_LINK_TYPE = "280"  # ARPHRD_CAN
MIN_CAN_QUEUE = 64  # frames; the kernel's default of 10 is less than a tick's frames on a full bus
MULTICAST_GROUP = "239.74.163.2"  # as deploy/python_can_bus.py has it


class Finding(NamedTuple):
    """Result of one check."""

    what: str
    good: bool
    found: str
    advice: str = ""  # what to do about it, where something is to be done


def findings() -> Iterator[Finding]:
    """Run all checks, in the order in which a newcomer needs them."""
    for look in CHECKS:
        yield look()


def check_python() -> Finding:
    """Python and its processor."""
    return Finding("Python", True, f"{platform.python_version()} on {platform.machine()}, {sys.executable}")


def check_processors() -> Finding:
    """Usable cores, and whether they save power."""
    usable = usable_cores()
    governors = {file.read_text().strip() for file in PROCESSORS.glob("cpu[0-9]*/cpufreq/scaling_governor")}
    found = f"{usable} usable" + (f", governor {', '.join(sorted(governors))}" if governors else "")
    slow = bool(governors - {"performance"})
    advice = "for wall-clock runs: cpupower frequency-set -g performance" if slow else ""
    return Finding("processors", not slow, found, advice)


def check_packages() -> Finding:
    """Whether all packages are there that acting on a robot needs."""
    lacking = missing()
    if not lacking:
        return Finding("packages", True, "all that acting on a robot needs")
    return Finding("packages", False, f"missing or too old: {_names(lacking)}", install(*map(str, lacking)))


def check_extras() -> Finding:
    """Which extras are installed."""
    lacking = {extra: missing(extra) for extra in extras() if extra not in FOR_DEVELOPERS}
    there = [extra for extra, packages in lacking.items() if not packages]
    absent = [extra for extra in lacking if extra not in there]
    if not absent:
        return Finding("extras", True, ", ".join(there))
    found = [", ".join(there)] if there else []
    found += [f"{extra} lacks {_names(lacking[extra])}" for extra in absent]
    return Finding("extras", False, "; ".join(found), f"where wanted: {install_extras(*absent)}")


def _names(packages: list[Requirement]) -> str:
    return ", ".join(package.name for package in packages)


def check_simulators() -> Finding:
    """Whether both simulators are of one release."""
    versions = {}
    for name in ("mujoco", "mujoco-mjx"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            for_training = name == "mujoco-mjx"  # the other one is among the packages
            advice = f"to train: {install_extras('train')}" if for_training else ""
            return Finding("simulators", for_training, f"{name} is not installed", advice)
    found = ", ".join(f"{name} {number}" for name, number in versions.items())
    same = len(set(versions.values())) == 1
    return Finding("simulators", same, found, "" if same else "both must be the same release")


def check_accelerator() -> Finding:
    """Whether JAX finds a device other than a processor."""
    if importlib.util.find_spec("jax") is None:
        return Finding("accelerator", False, "no JAX", f"to train: {install_extras('train')}")
    code = "import jax, json; print(json.dumps([d.device_kind for d in jax.devices()]))"
    succeeded, output = _probe(code)
    if not succeeded:
        return Finding("accelerator", False, "JAX does not start", output)
    kinds = json.loads(output)
    gpu = any(kind != "cpu" for kind in kinds)
    advice = "" if gpu else f"the gpu preset wants a GPU: {install('jax[cuda12]')}"
    return Finding("accelerator", gpu, ", ".join(kinds), advice)


def check_rendering() -> Finding:
    """Whether MuJoCo can draw without a display."""
    code = (
        "import mujoco\n"
        "model = mujoco.MjModel.from_xml_string("
        "'<mujoco><worldbody><geom size=\"1\"/></worldbody></mujoco>')\n"
        "with mujoco.Renderer(model, 32, 32) as renderer: renderer.render()\n"
    )
    chosen = os.environ.get("MUJOCO_GL")
    for backend in [chosen] if chosen else ["egl", "osmesa"]:
        if _probe(code, MUJOCO_GL=backend)[0]:
            return Finding("offscreen rendering", True, f"works with MUJOCO_GL={backend}")
    return Finding(
        "offscreen rendering", False, "no", "reports go without video; on Debian: apt install libegl1"
    )


def check_can() -> Finding:
    """CAN interfaces: whether there are any, up and with a long queue."""
    links = [
        path
        for path in sorted(NETWORK.glob("*"))
        if (path / "type").is_file() and (path / "type").read_text().strip() == CAN_LINK_TYPE
    ]
    if not links:
        socket_missing = "" if has_can_sockets() else ", and this system's kernel has no CAN sockets"
        advice = "only a real robot needs one; --bus sim does without"
        if socket_missing and sys.platform == "linux":
            advice += "; with an adapter: modprobe can_raw"
        return Finding("CAN interfaces", False, f"none{socket_missing}", advice)
    down = [link.name for link in links if _read(link / "operstate") == "down"]
    short = [link.name for link in links if 0 < int(_read(link / "tx_queue_len") or 0) < MIN_CAN_QUEUE]
    found = ", ".join(link.name + (" (down)" if link.name in down else "") for link in links)
    commands = [f"ip link set {name} up type can bitrate 1000000 restart-ms 100" for name in down]
    commands += [f"ip link set {name} txqueuelen {MIN_CAN_QUEUE}" for name in short]
    return Finding("CAN interfaces", not commands, found, "; ".join(commands))


def has_can_sockets() -> bool:
    """Whether the kernel knows the CAN protocol family."""
    if not hasattr(socket, "AF_CAN"):
        return False
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError:
        return False
    return True


def check_multicast() -> Finding:
    """Whether a simulated robot in another process could be reached (udp_multicast)."""
    what, membership = "multicast", socket.inet_aton(MULTICAST_GROUP) + socket.inet_aton("0.0.0.0")
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as joined:
            joined.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
    except OSError as error:
        advice = "--bus udp_multicast, a simulated robot in another process, needs a network with multicast"
        return Finding(what, False, f"no: {error.strerror or error}", advice)
    if importlib.util.find_spec("msgpack") is None:
        return Finding(what, False, "no msgpack", f"--bus udp_multicast needs it: {install('msgpack')}")
    return Finding(what, True, "works")


def _read(path: Path) -> str:
    """Content of a kernel file, empty if it cannot be read."""
    try:
        return path.read_text().strip()
    except OSError:
        return ""


def check_realtime() -> Finding:
    """Whether threads may have a real-time priority."""
    allowed = os.geteuid() == 0 or resource.getrlimit(resource.RLIMIT_RTPRIO)[0] != 0
    if hasattr(os, "sched_setscheduler"):
        parent = os.fork()
        if parent == 0:  # a child tries, so that this process keeps its own scheduling
            try:
                os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
            except OSError:
                os._exit(1)
            os._exit(0)
        allowed = os.waitpid(parent, 0)[1] == 0
    return Finding(
        "real-time scheduling",
        allowed,
        "permitted" if allowed else "not permitted",
        "" if allowed else "only a real robot needs it: raise rtprio in /etc/security/limits.conf",
    )


def check_locked_memory() -> Finding:
    """Whether enough memory may be locked."""
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    unlimited = limit == resource.RLIM_INFINITY
    good = unlimited or limit >= MIN_LOCKED_MEMORY or may_lock_beyond_the_limit()
    found = "unlimited" if unlimited else f"limit {limit / 2**20:.0f} MiB"
    return Finding(
        "memory locking", good, found, "" if good else "only a real robot needs it: raise memlock there too"
    )


def may_lock_beyond_the_limit() -> bool:
    """Whether a block larger than the limit can be locked (a privileged process may)."""
    library = ctypes.CDLL(None, use_errno=True)
    block = ctypes.create_string_buffer(16 * 2**20)
    locked = library.mlock(block, ctypes.c_size_t(len(block))) == 0
    if locked:
        library.munlock(block, ctypes.c_size_t(len(block)))
    return locked


def check_cache() -> Finding:
    """Size of the cache of compiled programs."""
    folder = compilation_cache()
    files = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    found = f"{folder}: {len(files)} files, {sum(files) / 2**20:.0f} MiB" if files else f"{folder}: empty"
    return Finding("compilation cache", True, found)


def _probe(code: str, **environment: str) -> tuple[bool, str]:
    """Run Python apart; returns whether it succeeded, and its last line."""
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-c", code],
            env=os.environ | environment,
            capture_output=True,
            text=True,
            timeout=PROBE_LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"no answer within {PROBE_LIMIT_S} s"
    lines = (done.stdout if done.returncode == 0 else done.stderr).strip().splitlines()
    return done.returncode == 0, lines[-1] if lines else ""


CHECKS: tuple[Callable[[], Finding], ...] = (
    check_python,
    check_processors,
    check_packages,
    check_extras,
    check_simulators,
    check_accelerator,
    check_rendering,
    check_cache,
    check_can,
    check_multicast,
    check_realtime,
    check_locked_memory,
)
