"""The packages and the source that a run was made with."""

import hashlib
import subprocess
from functools import cache
from pathlib import Path

from footfall.common.sources import TRAINING, read_sources

PACKAGES = ("footfall", "mujoco", "mujoco-mjx", "jax", "jaxlib", "brax", "numpy", "onnx", "onnxruntime")


def source_revision() -> str:
    """The revision of the source files.

    In a checkout: the commit, and a digest of uncommitted changes. Elsewhere: a digest of the files
    that training imports.
    """
    here = Path(__file__)

    def git(*arguments: str) -> str:
        result = subprocess.run(
            ["git", *arguments], cwd=here.parent, capture_output=True, check=True, timeout=10
        )
        return result.stdout.decode(errors="replace").strip()

    try:
        # Fails where the environment lies in another repository.
        git("ls-files", "--error-unmatch", here.name)
        changes = git("diff", "HEAD", "--no-ext-diff", "--binary")
        return git("rev-parse", "HEAD") + (f" with uncommitted changes {_digest(changes)}" if changes else "")
    except (OSError, subprocess.SubprocessError):
        return f"digest {_digest(repr(read_sources(here.parents[2], TRAINING, ('*.py', '*.yaml'))))}"


@cache
def imported_revision() -> str:
    """The revision at this function's first call: the process does not run later changes of the files."""
    return source_revision()


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]
