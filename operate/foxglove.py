"""Starts the WebSocket server for Foxglove, Lichtblick and PlotJuggler in a separate process."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

from footfall.common.child_process import end_by_closing_input
from footfall.common.errors import UserError
from footfall.common.installation import extras_command

READY = "ready"
EXIT_TIMEOUT_S = 3.0  # maximum wait
PORT = 8765  # default of these tools


@contextmanager
def foxglove_served(feed: Path, host: str, port: int = PORT) -> Iterator[str]:
    """Serve a run's feed to viewers, read-only, while the context is open.

    Args:
        feed: socket of the run's telemetry; it may be created later.
        host, port: address to listen on.

    Yields:
        The address for the viewers.

    Raises:
        UserError: the extra is not installed, or the server cannot listen there.
    """
    if find_spec("foxglove") is None:
        raise UserError(f"--foxglove needs the extra foxglove: {extras_command('foxglove')}")
    command = [sys.executable, "-P", "-m", "footfall.operate.foxglove_server", str(feed), host, str(port)]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    try:
        answer = process.stdout.readline().strip()
        if answer != READY:
            raise UserError(
                f"cannot serve Foxglove at {host}:{port}: {answer or 'the server does not start'}"
            )
        yield f"ws://{host}:{port}"
    finally:
        end_by_closing_input(process, EXIT_TIMEOUT_S)
