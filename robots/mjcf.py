"""Reads MJCF files."""

from pathlib import Path

import mujoco

from footfall.common.errors import UserError

MAX_POINTS = 2**26  # of a texture or a height field


def load_spec(path: Path) -> mujoco.MjSpec:
    """Read an MJCF file.

    Raises:
        UserError: the file is missing or is not valid MJCF.
    """
    if not path.is_file():
        raise UserError(f"no MJCF file at {path}")
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, UnicodeDecodeError, mujoco.FatalError) as error:
        raise UserError(f"{path} is not valid MJCF: {' '.join(str(error).split())}") from None
    _check_size(spec, path)
    return spec


def _check_size(spec: mujoco.MjSpec, path: Path) -> None:
    """Refuse textures and height fields at which MuJoCo's compiler crashes, or takes minutes."""
    for what, parts in (
        ("texture", [(each.name, each.width * each.height) for each in spec.textures]),
        ("height field", [(each.name, each.nrow * each.ncol) for each in spec.hfields]),
    ):
        for name, points in parts:
            if points > MAX_POINTS:
                raise UserError(f"{path}: {what} '{name}' has {points:,} points: {MAX_POINTS:,} at most")
