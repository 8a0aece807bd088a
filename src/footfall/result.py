"""The result of a run: kept and shown wherever anything can be written."""

import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from footfall.common.errors import UserError
from footfall.common.in_time import in_time
from footfall.common.outputs import write_json
from footfall.deploy.process_end import handling
from footfall.exit_status import BAD_INPUT
from footfall.output import discard_output


def write_and_show(figures: dict[str, Any], path: Path | None, show: Callable[[], None], status: int) -> int:
    """Write a run's figures and show them; neither depends on the other.

    If one fails, a line on standard error has the final state and the faults. Figures that cannot be written
    to their file, or shown if there is no file, are kept in the folder for temporary files.

    Args:
        figures: with `final_state` and `faults`.
        path: of the JSON file, if one was asked for.
        show: prints a summary.
        status: the run's exit status.

    Returns:
        The run's exit status; `BAD_INPUT` if a run that ended well did not reach its file, or, without one,
        the standard output.

    Raises:
        BrokenPipeError: the reader of the output is gone, and nothing else went wrong.
    """
    with handling(lambda *_: None):  # a terminal that closes sends SIGHUP twice
        not_written, not_shown = _write(path, figures), _shown(show)
        if not (not_written or not_shown):
            return status
        if not (status or not_written) and isinstance(not_shown, BrokenPipeError | SystemExit):
            raise BrokenPipeError
        lost = not_written or (path is None and not_shown)
        parts = [
            not_written,
            f"cannot show the result: {not_shown}" if not_shown else "",
            _keep_elsewhere(figures) if lost else "",
            f"the run ended: {', '.join([figures['final_state'], *figures['faults']])}",
        ]
        line = "; ".join(filter(None, parts))
        in_time(lambda: print(f"footfall: {line}", file=sys.stderr, flush=True))
        return (status or BAD_INPUT) if lost else status


def _write(path: Path | None, figures: dict[str, Any]) -> str:
    """Write the figures; returns why they cannot be, empty if they are."""
    try:
        write_json(path, figures)
    except UserError as error:
        return str(error)
    return ""


def _shown(show: Callable[[], None]) -> BaseException | None:
    """Show the summary; returns what went wrong."""

    def act() -> None:
        show()
        sys.stdout.flush()

    wrong = in_time(act)
    if wrong is not None and not isinstance(wrong, TimeoutError):
        discard_output()
    return wrong


def _keep_elsewhere(figures: dict[str, Any]) -> str:
    """Write the figures to the folder for temporary files; returns a line about it, empty if that fails."""
    with suppress(UserError, OSError):
        path = Path(tempfile.gettempdir()) / f"footfall-{os.getpid()}.json"
        write_json(path, figures)
        return f"the figures are in {path}"
    return ""
