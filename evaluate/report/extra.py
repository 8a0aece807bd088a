"""The libraries that a report needs; a robot's small computer does not have them."""

import os
import sys
from importlib.util import find_spec

from footfall.common.errors import UserError
from footfall.common.installation import extras_command

LIBRARIES = ("jinja2", "matplotlib", "imageio_ffmpeg", "PIL")


def check_installed() -> None:
    """Check that a report can be written, before the long run.

    Raises:
        UserError: a library of the extra `report` is missing.
    """
    missing = [name for name in LIBRARIES if find_spec(name) is None]
    if missing:
        raise UserError(
            f"an HTML report needs {', '.join(missing)}, which is not installed: {extras_command('report')}"
        )


def check_display() -> None:
    """Raise UserError if MUJOCO_GL selects GLFW windows and there is no display."""
    has_display = sys.platform != "linux" or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    if os.environ.get("MUJOCO_GL") == "glfw" and not has_display:
        raise UserError(
            "MUJOCO_GL=glfw films on a display, and there is none: unset it, or give MUJOCO_GL=egl"
        )
