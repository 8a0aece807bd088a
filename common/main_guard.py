"""A check of scripts that start processes: each new process imports the script."""

import ast
import sys
from pathlib import Path

from footfall.common.errors import UserError


def check_main_guard() -> None:
    """Check that the calling script's main part is under `if __name__ == "__main__":`.

    Without it, each process that Python spawns would run the script again, and fail in forty lines.

    Raises:
        UserError: this guard is missing in the script.
    """
    main = sys.modules.get("__main__")
    frame = sys._getframe()
    while frame.f_back is not None and (
        frame.f_code.co_name != "<module>" or frame.f_globals is not vars(main)
    ):
        frame = frame.f_back
    script = Path(frame.f_code.co_filename)
    if frame.f_globals is not vars(main) or frame.f_code.co_name != "<module>" or not script.is_file():
        return
    guards = (node for node in ast.walk(ast.parse(script.read_bytes())) if isinstance(node, ast.If))
    if not any(
        "__name__" in ast.unparse(node.test) and node.lineno <= frame.f_lineno <= (node.end_lineno or 0)
        for node in guards
    ):
        raise UserError(
            f"{script.name}, line {frame.f_lineno} starts processes that import {script.name}:"
            ' put its main part under if __name__ == "__main__":'
        )
