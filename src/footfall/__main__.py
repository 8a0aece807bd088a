"""Entry point of `footfall` and `python -m footfall`."""

import os
import sys
from contextlib import suppress

from footfall.exit_status import INTERRUPTED, TERMINATED


def main() -> int:
    """Run the command line. Ctrl-C ends in one line, also while the command line is loading."""
    try:
        _start_device(sys.argv[1:])
        from footfall.cli import main as command_line

        status = command_line()
        _leave_at_once_if_blocked(status)
        _leave_at_once_if_compiling(status)
        return status
    except KeyboardInterrupt:
        print("footfall: interrupted", file=sys.stderr)
        return INTERRUPTED


def _start_device(arguments: list[str]) -> None:
    """Start the device of a training while the command line loads, to save time.

    A resumed run starts it later, after its folder is found, and a process of a cluster after it has joined.
    """
    later_options = ("-h", "--help", "--resume", "--coordinator", "--process")
    if arguments[:1] == ["train"] and not any(argument.startswith(later_options) for argument in arguments):
        from footfall.train.entry import start_device

        start_device()


def _leave_at_once_if_blocked(status: int) -> None:
    """Exit without flushing if an output is blocked (Ctrl-S): Python would wait for it, or abort."""
    from footfall.common.blocking_threads import any_call_blocked

    if any_call_blocked():
        os._exit(status)


def _leave_at_once_if_compiling(status: int) -> None:
    """After Ctrl-C or SIGTERM, exit without waiting for a compiler, as Python would."""
    from footfall.common.blocking_threads import any_compiling

    if status in (INTERRUPTED, TERMINATED) and any_compiling():
        with suppress(OSError):
            sys.stdout.flush()
        os._exit(status)


if __name__ == "__main__":
    sys.exit(main())
