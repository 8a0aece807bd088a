"""A full disk."""

import os
from pathlib import Path


def fill(disk: Path, leaving: int = 0) -> Path:
    """Fill a disk, except for this number of bytes."""
    filler = disk / "filler"
    free = os.statvfs(disk).f_bavail * os.statvfs(disk).f_frsize
    filler.write_bytes(b"x" * (free - leaving))
    return filler
