"""`footfall`, and `python -m footfall`."""

import sys

from footfall.exit_status import INTERRUPTED


def main() -> int:
    """Run the command line; while it is still being loaded, too, Ctrl-C ends in one line."""
    try:
        from footfall.cli import main as command_line

        return command_line()
    except KeyboardInterrupt:
        print("footfall: interrupted", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
