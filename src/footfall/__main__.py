"""`footfall`, and `python -m footfall`."""

import os
import sys

from footfall.exit_status import INTERRUPTED


def main() -> int:
    """Run the command line; while it is still being loaded, too, Ctrl-C ends in one line."""
    try:
        _start_device(sys.argv[1:])
        from footfall.cli import main as command_line

        status = command_line()
        _leave_at_once_if_blocked(status)
        return status
    except KeyboardInterrupt:
        print("footfall: interrupted", file=sys.stderr)
        return INTERRUPTED


def _start_device(arguments: list[str]) -> None:
    """Start the device of a training before the command line is loaded, which takes as long.

    A resumed run is looked for first. Processes of a cluster join it first.
    """
    later = ("-h", "--help", "--resume", "--coordinator", "--process")
    if arguments[:1] == ["train"] and not any(argument.startswith(later) for argument in arguments):
        from footfall.train.entry import start_device

        start_device()


def _leave_at_once_if_blocked(status: int) -> None:
    """End without flushing outputs where one takes nothing (Ctrl-S): Python would wait for it, or abort."""
    from footfall.common.in_time import any_blocked

    if any_blocked():
        os._exit(status)


if __name__ == "__main__":
    sys.exit(main())
