"""Output files that are either whole or not there, and known to be writable before a long run."""

import os
import tempfile
from pathlib import Path

from robots.errors import UserError
from robots.files import write_atomically


def check_writable(*paths: Path | None) -> None:
    """Make sure that files can be written where they are wanted; makes their folders. None is passed over.

    Raises:
        UserError: a path is a folder, its folder cannot be made, or no file can be made in it.
    """
    for path in paths:
        if path is None:
            continue
        if path.is_dir():
            raise UserError(f"cannot write {path}: it is a folder, give a file name")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle, probe = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        except OSError as error:
            raise UserError(f"cannot write {path}: {error.strerror or error}") from None
        os.close(handle)
        Path(probe).unlink()


def write_text(path: Path, content: str) -> None:
    """Write a text file whole or not at all.

    Raises:
        UserError: the file cannot be written.
    """
    try:
        write_atomically(path, content.encode())
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror or error}") from None
