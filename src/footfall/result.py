"""Output of a run's result, robust against failing files and terminals."""

import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from footfall.common.blocking_threads import call_with_timeout
from footfall.common.errors import UserError
from footfall.common.outputs import write_json
from footfall.deploy.process_end import handling
from footfall.exit_status import BAD_INPUT
from footfall.output import discard_output


def write_and_show(figures: dict[str, Any], path: Path | None, show: Callable[[], None], status: int) -> int:
    """Write a run's figures and show them; each happens even if the other fails.

    If one fails, a line on stderr has the final state and the faults. Figures that cannot be written to
    their file, or without a file cannot be shown, are saved in the folder for temporary files.

    Args:
        figures: figures of the run, including `final_state` and `faults`.
        path: JSON file, if requested.
        show: prints a summary.
        status: exit status of the run.

    Returns:
        The exit status of the run; `BAD_INPUT` if the run succeeded and its figures could not be written to
        their file, or without a file could not be shown.

    Raises:
        BrokenPipeError: the reader of the output has closed it, and nothing else failed.
    """
    with handling(lambda *_: None):  # a closing terminal sends SIGHUP twice
        not_written, not_shown = _write(path, figures), _show_with_timeout(show)
        if not (not_written or not_shown):
            return status
        # With a closed output, rich raises SystemExit.
        if not (status or not_written) and isinstance(not_shown, BrokenPipeError | SystemExit):
            raise BrokenPipeError
        lost = not_written or (path is None and not_shown)
        parts = [
            not_written,
            f"cannot show the result: {not_shown}" if not_shown else "",
            _save_elsewhere(figures) if lost else "",
            f"the run ended: {', '.join([figures['final_state'], *figures['faults']])}",
        ]
        line = "; ".join(filter(None, parts))
        call_with_timeout(lambda: print(f"footfall: {line}", file=sys.stderr, flush=True))
        return (status or BAD_INPUT) if lost else status


def _write(path: Path | None, figures: dict[str, Any]) -> str:
    """Write the figures; returns the reason for a failure, else an empty string."""
    try:
        write_json(path, figures)
    except UserError as error:
        return str(error)
    return ""


def _show_with_timeout(show: Callable[[], None]) -> BaseException | None:
    """Show the summary; returns the exception of a failure."""

    def act() -> None:
        show()
        sys.stdout.flush()

    error = call_with_timeout(act)
    if error is not None and not isinstance(error, TimeoutError):
        discard_output()
    return error


def _save_elsewhere(figures: dict[str, Any]) -> str:
    """Write the figures to the folder for temporary files; returns a message, empty if that fails."""
    with suppress(UserError, OSError):
        path = Path(tempfile.gettempdir()) / f"footfall-{os.getpid()}.json"
        write_json(path, figures)
        return f"the figures are in {path}"
    return ""
