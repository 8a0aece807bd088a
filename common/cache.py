"""The folder of compiled programs."""

import hashlib
import os
import platform
from pathlib import Path

from footfall.common.user_folders import cache_home

CPU_INFO = Path("/proc/cpuinfo")
# Lines of CPU_INFO that identify a kind of CPU.
KIND_FIELDS = ("model name", "flags", "CPU implementer", "CPU part", "Features")


def compilation_cache() -> Path:
    """Folder of JAX's compilation cache: from the environment, or else in the user's cache folder.

    There each kind of CPU has a folder of its own: machines may share a home, and JAX would load
    programs that were compiled for another CPU.

    Raises:
        UserError: the user has no such folder.
    """
    configured = os.environ.get("JAX_COMPILATION_CACHE_DIR")
    if configured is not None:
        return Path(configured)
    return cache_home() / "footfall" / "jax" / processor_kind()


def processor_kind() -> str:
    """A name for this machine's kind of CPU: instruction set, and a digest of model and features."""
    try:
        first_cpu, _, _ = CPU_INFO.read_text(encoding="utf-8", errors="replace").partition("\n\n")
    except OSError:  # not Linux
        first_cpu = f"model name: {platform.processor()}"
    facts = sorted(line for line in first_cpu.splitlines() if line.partition(":")[0].strip() in KIND_FIELDS)
    return f"{platform.machine()}-{hashlib.sha256(chr(10).join(facts).encode()).hexdigest()[:8]}"
