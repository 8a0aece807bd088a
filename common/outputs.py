"""Output files of commands: checked before the work begins, and written completely or not at all."""

import errno
import json
import math
import os
import stat
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from footfall.common.errors import UserError
from footfall.common.files import is_named_pipe, write_atomically


def check_outputs(*paths: Path | None, inputs: Iterable[Path | str | None] = ()) -> None:
    """Check that files can be written, without leaving a trace.

    Args:
        paths: the outputs; None for one that is not requested.
        inputs: files that the command reads. Texts that are not files, such as a policy's name, are skipped.

    Raises:
        UserError: a file cannot be written, two outputs are the same, or an output would overwrite an input.
    """
    outputs = [path for path in paths if path is not None]
    input_files = {_target(Path(each)) for each in inputs if each is not None and os.path.isfile(each)}
    for path in outputs:
        if _target(path) in input_files:
            raise UserError(f"cannot write {path}: it is read by this command; give another name")
        if reason := _obstacle(path):
            raise UserError(f"cannot write {path}: {reason}")
    targets = [_target(path) for path in outputs]
    for path, target in zip(outputs, targets, strict=True):
        if targets.count(target) > 1:
            raise UserError(f"cannot write two outputs to {path}: give each its own name")


def _obstacle(path: Path) -> str:
    """Why a file cannot be written; empty if it can."""
    if is_named_pipe(path):
        return "it is a named pipe, which may block for ever; give a file name"
    try:
        with suppress(FileNotFoundError):
            if stat.S_ISDIR(os.stat(path).st_mode):
                return "it is a folder; give a file name"
        if is_device(path):
            return ""
        with tempfile.TemporaryFile(dir=_folder(path)):
            return ""
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            return "the name is too long; give a shorter one"
        if _folder(path).is_dir():
            return (
                "no file can be made in this folder" if error.errno == errno.ENOENT else str(error.strerror)
            )
        return f"there is no folder {_folder(path)}"


def write_text(path: Path, text: str) -> None:
    """Write a complete file; a device such as /dev/stdout is written to directly.

    Raises:
        UserError: it cannot be written.
    """
    try:
        if is_device(path):
            path.write_text(text, encoding="utf-8")
        else:
            write_atomically(_target(path), text.encode())
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from None


def write_json(path: Path | None, content: Any) -> None:
    """Write figures as JSON, if a path is given; NaN and infinity become null."""
    if path is not None:
        write_text(path, json.dumps(_plain(content), indent=2, allow_nan=False) + "\n")


def is_device(path: Path) -> bool:
    """Whether a path exists and is neither a file nor a folder: /dev/stdout, a pipe."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _target(path: Path) -> Path:
    """The path with links resolved; circular links, on which `Path.resolve` fails, stay as they are."""
    return Path(os.path.realpath(path))


def _folder(path: Path) -> Path:
    return _target(path).parent


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):  # a NumPy array; this module is imported by every verb, and NumPy is not
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
