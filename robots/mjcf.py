"""Reads MJCF files."""

from pathlib import Path

import mujoco

from footfall.common.errors import UserError


def load_spec(path: Path) -> mujoco.MjSpec:
    """Read an MJCF file.

    Raises:
        UserError: the file is missing or is no valid MJCF.
    """
    if not path.is_file():
        raise UserError(f"no MJCF file at {path}")
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, UnicodeDecodeError, mujoco.FatalError) as error:
        raise UserError(f"{path} is not valid MJCF: {' '.join(str(error).split())}") from None
