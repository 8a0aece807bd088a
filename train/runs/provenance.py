"""What a run was made with: packages and revision."""

import subprocess
from pathlib import Path

PACKAGES = ("footfall", "mujoco", "mujoco-mjx", "jax", "jaxlib", "brax", "numpy", "onnx", "onnxruntime")


def git_revision() -> str:
    """Commit of the source tree, marked where files differ from it; 'unknown' outside a repository."""
    here = Path(__file__).parent

    def git(*arguments: str) -> str:
        result = subprocess.run(
            ["git", *arguments], cwd=here, capture_output=True, text=True, check=True, timeout=10
        )
        return result.stdout.strip()

    try:
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "HEAD") + (" with uncommitted changes" if changed else "")
    except (OSError, subprocess.SubprocessError):
        return "unknown"
