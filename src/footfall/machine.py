"""Checks of this machine for `footfall doctor`, one finding each."""

import importlib.util
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version

from packaging.requirements import Requirement

from footfall.common.cache import compilation_cache
from footfall.common.errors import UserError
from footfall.common.installation import extras, extras_command, install_command, missing
from footfall.finding import Finding
from footfall.robot_computer import ROBOT_COMPUTER

PROBE_LIMIT_S = 60
FOR_DEVELOPERS = ("dev",)


def findings() -> Iterator[Finding]:
    """Run all checks, in the order in which a new user needs them."""
    for check in CHECKS:
        yield check()


def check_python() -> Finding:
    """Version of Python, and the processor."""
    return Finding("Python", True, f"{platform.python_version()} on {platform.machine()}, {sys.executable}")


def check_packages() -> Finding:
    """Whether all packages for running on a robot are installed."""
    missing_packages = missing()
    if not missing_packages:
        return Finding("packages", True, "all that are required on a robot")
    return Finding(
        "packages",
        False,
        f"missing or too old: {_names(missing_packages)}",
        install_command(*map(str, missing_packages)),
    )


def check_extras() -> Finding:
    """Installed extras."""
    missing_by_extra = {extra: missing(extra) for extra in extras() if extra not in FOR_DEVELOPERS}
    complete = [extra for extra, packages in missing_by_extra.items() if not packages]
    incomplete = [extra for extra in missing_by_extra if extra not in complete]
    if not incomplete:
        return Finding("extras", True, ", ".join(complete))
    found = [", ".join(complete)] if complete else []
    found += [f"{extra} lacks {_names(missing_by_extra[extra])}" for extra in incomplete]
    return Finding("extras", False, "; ".join(found), f"if you need them: {extras_command(*incomplete)}")


def _names(packages: list[Requirement]) -> str:
    return ", ".join(package.name for package in packages)


def check_simulators() -> Finding:
    """Whether both simulators have the same release."""
    versions = {}
    for name in ("mujoco", "mujoco-mjx"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            for_training = name == "mujoco-mjx"  # mujoco is among the required packages
            advice = f"to train: {extras_command('train')}" if for_training else ""
            return Finding("simulators", for_training, f"{name} is not installed", advice)
    found = ", ".join(f"{name} {number}" for name, number in versions.items())
    same = len(set(versions.values())) == 1
    return Finding("simulators", same, found, "" if same else "both must be the same release")


def check_accelerator() -> Finding:
    """Whether JAX finds a device other than a CPU."""
    if importlib.util.find_spec("jax") is None:
        return Finding("accelerator", False, "no JAX", f"to train: {extras_command('train')}")
    code = "import jax, json; print(json.dumps([d.device_kind for d in jax.devices()]))"
    succeeded, output = _probe(code)
    if not succeeded:
        return Finding("accelerator", False, "JAX does not start", output)
    kinds = json.loads(output)
    gpu = any(kind != "cpu" for kind in kinds)
    advice = "" if gpu else f"the gpu preset needs a GPU: {install_command('jax[cuda12]')}"
    return Finding("accelerator", gpu, ", ".join(kinds), advice)


def check_rendering() -> Finding:
    """Whether MuJoCo can render without a display."""
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
        "offscreen rendering", False, "no", "reports have no video; on Debian: apt install libegl1"
    )


def check_cache() -> Finding:
    """Size of the cache of compiled programs."""
    try:
        folder = compilation_cache()
    except UserError as error:
        return Finding("compilation cache", False, str(error), "each training compiles anew until then")
    files = [path.stat().st_size for path in folder.rglob("*") if path.is_file()]
    found = f"{folder}: {len(files)} files, {sum(files) / 2**20:.0f} MiB" if files else f"{folder}: empty"
    return Finding("compilation cache", True, found)


def _probe(code: str, **environment: str) -> tuple[bool, str]:
    """Run Python code in a separate process; returns whether it succeeded, and its last line."""
    try:
        process = subprocess.run(
            [sys.executable, "-P", "-c", code],
            env=os.environ | environment,
            capture_output=True,
            text=True,
            timeout=PROBE_LIMIT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, f"no answer within {PROBE_LIMIT_S} s"
    lines = (process.stdout if process.returncode == 0 else process.stderr).strip().splitlines()
    return process.returncode == 0, lines[-1] if lines else ""


CHECKS: tuple[Callable[[], Finding], ...] = (
    check_python,
    check_packages,
    check_extras,
    check_simulators,
    check_accelerator,
    check_rendering,
    check_cache,
    *ROBOT_COMPUTER,
)
