"""`footfall`, and `python -m footfall`."""

import os
import sys

from footfall.exit_status import INTERRUPTED


def main() -> int:
    """Run the command line; while it is still being loaded, too, Ctrl-C ends in one line."""
    try:
        from footfall.cli import main as command_line

        status = command_line()
        _leave_at_once_if_blocked(status)
        return status
    except KeyboardInterrupt:
        print("footfall: interrupted", file=sys.stderr)
        return INTERRUPTED


def _leave_at_once_if_blocked(status: int) -> None:
    """End without flushing outputs where one takes nothing (Ctrl-S): Python would wait for it, or abort."""
    from footfall.common.in_time import any_blocked

    if any_blocked():
        os._exit(status)


if __name__ == "__main__":
    sys.exit(main())
