"""Files that are either complete or absent."""

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

SPARE_DESCRIPTORS = 4
SHOWN_NAME = 32  # characters of a file's name in that of its temporary file: a name has 255 bytes at most


def write_atomically(path: Path, content: bytes, mode: int | None = None) -> None:
    """Write a file so that a reader, or a run that resumes, sees the old content or all of the new.

    The data reaches the disk before the name does.

    Args:
        mode: permissions (default: by the user's umask).
    """
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:SHOWN_NAME]}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o666 & ~_umask() if mode is None else mode)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def is_named_pipe(path: Path) -> bool:
    """Whether a path is a FIFO, which may block when opened. /dev/stdout and `<(...)` do not count."""
    try:
        return stat.S_ISFIFO(os.stat(path).st_mode) and os.path.exists(os.path.realpath(path))
    except OSError:
        return False


@contextmanager
def spare_descriptors() -> Iterator[list[int]]:
    """Reserve file descriptors: close them to write files when a run has used up all others."""
    spare = [os.open(os.devnull, os.O_RDONLY) for _ in range(SPARE_DESCRIPTORS)]
    try:
        yield spare
    finally:
        release(spare)


def release(spare: list[int]) -> None:
    """Close spare descriptors; those closed already are skipped."""
    while spare:
        with suppress(OSError):
            os.close(spare.pop())


def _umask() -> int:
    """The process's file-creation mask, which can only be read by setting it."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
