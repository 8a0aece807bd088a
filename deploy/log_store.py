"""Store of the logs that runs on real buses write automatically, with a limit of disk space.

The folder is `$XDG_STATE_HOME/footfall/logs`, by default `~/.local/state/footfall/logs`. Only files there
with the name of such a log are ever deleted: the oldest first, none that a run writes. A long run is stored
in parts: if it exceeds the space, its first and its last part stay.
"""

import os
import re
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from footfall.common.errors import UserError
from footfall.common.locks import locked
from footfall.common.user_folders import state_home

PARTS = 8  # one part of a log may use this fraction of the space
NAME = re.compile(r".+-\d{8}-\d{6}-\d+(\.part\d+)?\.mcap")


class LogStore(NamedTuple):
    """A folder of logs, with the space that they may use."""

    folder: Path
    max_bytes: int

    @property
    def part_bytes(self) -> int:
        """Size of a file after which a log continues in another file."""
        return self.max_bytes // PARTS

    def new_log(self, robot: str) -> Path:
        """Name for a run's log. Creates the folder, and makes room in it.

        Raises:
            UserError: the folder cannot be created.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self.make_room()
        except OSError as error:
            raise UserError(f"cannot store logs in {self.folder}: {error.strerror}; use --log FILE") from None
        return self.folder / f"{robot}-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.mcap"

    def make_room(self) -> None:
        """Delete the oldest logs until there is room for another part.

        Raises:
            OSError: the folder cannot be read.
        """
        logs = [path for path in self.folder.iterdir() if NAME.fullmatch(path.name) and not path.is_symlink()]
        found = sorted((path.stat().st_mtime, path.stat().st_size, path) for path in logs if path.is_file())
        used = sum(size for _, size, _ in found)
        for _, size, path in found:
            if used <= self.max_bytes - self.part_bytes:
                return
            with suppress(UserError, OSError):  # a run writes it, or it was deleted
                with locked(lock_name(path), f"the log {path}"):
                    path.unlink()
                used -= size


def lock_name(path: Path) -> str:
    """Name of the lock of a log's writer."""
    status = path.stat()
    return f"log/{status.st_dev}:{status.st_ino}"


def next_part(path: Path) -> Path:
    """Next file of a log: `x.mcap`, `x.part2.mcap`, `x.part3.mcap`."""
    stem, _, number = path.stem.partition(".part")
    return path.with_name(f"{stem}.part{int(number or 1) + 1}.mcap")


def default_store(max_bytes: int) -> LogStore:
    """Log store of this user. Raises UserError if the user has no folder for it."""
    try:
        folder = state_home()
    except UserError as error:
        raise UserError(f"cannot store logs: {error}, or use --log FILE") from None
    return LogStore(folder / "footfall" / "logs", max_bytes)
