"""Files that no other user can have written: needed for content that is executed."""

import os
import stat
from contextlib import suppress
from pathlib import Path

from footfall.common.files import write_atomically

OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
OTHERS_MAY_ENTER = stat.S_IXGRP | stat.S_IXOTH


class NotPrivateError(Exception):
    """Another user may have written a file; the message has the reason."""


def read_private(path: Path) -> bytes:
    """Content of a file. File and folder must belong to this user and be writable by no other.

    Raises:
        NotPrivateError: another user may have written one of them.
        OSError: the file cannot be read, or is a symbolic link.
    """
    _check(path.parent, os.stat(path.parent, follow_symlinks=False))
    with os.fdopen(os.open(path, os.O_RDONLY | os.O_NOFOLLOW), "rb") as file:
        _check(path, os.fstat(file.fileno()))  # the opened file, not the path, which may change meanwhile
        return file.read()


def write_private(path: Path, content: bytes) -> None:
    """Write a file that `read_private` accepts, and its folder if there is none.

    Raises:
        NotPrivateError: the folder belongs to another user, or others may write to it.
        OSError: it cannot be written.
    """
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    _check(path.parent, os.stat(path.parent, follow_symlinks=False))
    write_atomically(path, content, mode=0o600)


def make_private_folder(folder: Path) -> None:
    """Make or check a folder: no other user may be able to write to it or to the files in it.

    Raises:
        NotPrivateError: others can.
        OSError: the folder cannot be created or read.
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    status = os.stat(folder, follow_symlinks=False)
    _check(folder, status)
    if status.st_mode & OTHERS_MAY_ENTER:
        with os.scandir(folder) as entries:
            for entry in entries:
                with suppress(FileNotFoundError):  # deleted by another process
                    _check(Path(entry.path), entry.stat(follow_symlinks=False))


def _check(path: Path, status: os.stat_result) -> None:
    if stat.S_ISLNK(status.st_mode):
        raise NotPrivateError(f"{path} is a symbolic link")
    if status.st_uid != os.getuid():
        raise NotPrivateError(f"{path} belongs to another user")
    if status.st_mode & OTHERS_MAY_WRITE:
        raise NotPrivateError(f"others may write to {path}")
