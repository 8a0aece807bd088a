"""What a run was made with: packages and revision."""

import hashlib
import subprocess
from pathlib import Path

PACKAGES = ("footfall", "mujoco", "mujoco-mjx", "jax", "jaxlib", "brax", "numpy", "onnx", "onnxruntime")


def git_revision() -> str:
    """Commit of the source tree, and a digest of what differs from it; 'unknown' outside a repository."""
    here = Path(__file__).parent

    def git(*arguments: str) -> str:
        result = subprocess.run(["git", *arguments], cwd=here, capture_output=True, check=True, timeout=10)
        return result.stdout.decode(errors="replace").strip()

    try:
        changes = git("diff", "HEAD", "--no-ext-diff", "--binary")
        digest = hashlib.sha256(changes.encode()).hexdigest()[:8]
        return git("rev-parse", "HEAD") + (f" with uncommitted changes {digest}" if changes else "")
    except (OSError, subprocess.SubprocessError):
        return "unknown"
