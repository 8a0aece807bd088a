"""Where compiled programs are kept."""

import os
from pathlib import Path


def compilation_cache() -> Path:
    """JAX's compilation cache: where the environment says, or else among the user's caches."""
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    return Path(os.environ.get("JAX_COMPILATION_CACHE_DIR", home / "footfall" / "jax"))
