"""The user's folders for caches and for state (XDG base directories)."""

import os
from pathlib import Path

from footfall.common.errors import UserError


def cache_home() -> Path:
    """Folder for what can be made again; raises UserError if the user has none."""
    return _folder("XDG_CACHE_HOME", ".cache")


def state_home() -> Path:
    """Folder for logs and other records; raises UserError if the user has none."""
    return _folder("XDG_STATE_HOME", ".local/state")


def _folder(variable: str, within_home: str) -> Path:
    """The folder that an environment variable names, or else one in the user's home."""
    if given := os.environ.get(variable):
        return Path(given)
    try:
        return Path.home() / within_home
    except RuntimeError:  # HOME is not set, and the system does not know the user, as in many containers
        raise UserError(f"this user has no home folder: set HOME or {variable}") from None
