"""Where compiled programs are kept."""

import hashlib
import os
import platform
from pathlib import Path

CPU_INFO = Path("/proc/cpuinfo")
OF_THE_KIND = (
    "model name",
    "flags",
    "CPU implementer",
    "CPU part",
    "Features",
)  # which it tells of


def compilation_cache() -> Path:
    """Folder of JAX's compilation cache: as the environment sets it, else among the user's caches.

    There each kind of processor has a folder of its own, since a home may be shared by unlike ones and JAX
    finds what was compiled for another.
    """
    named = os.environ.get("JAX_COMPILATION_CACHE_DIR")
    if named is not None:
        return Path(named)
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return home / "footfall" / "jax" / processor_kind()


def processor_kind() -> str:
    """A name for this machine's kind of processor: instruction set, and a digest of model and features."""
    try:
        first, _, _ = CPU_INFO.read_text(encoding="utf-8", errors="replace").partition("\n\n")
    except OSError:  # not Linux
        first = f"model name: {platform.processor()}"
    facts = sorted(line for line in first.splitlines() if line.partition(":")[0].strip() in OF_THE_KIND)
    return f"{platform.machine()}-{hashlib.sha256(chr(10).join(facts).encode()).hexdigest()[:8]}"
