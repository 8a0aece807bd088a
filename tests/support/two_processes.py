"""`footfall` with the given arguments and `--process 0` and `--process 1`, forked after the imports.

Each of both writes its output to a file of its own. The exit status is 0 if theirs are.
"""

import os
import sys

import footfall.train.brax.trainer  # noqa: F401
from footfall.__main__ import main

if __name__ == "__main__":
    for index in "01":
        if os.fork() == 0:
            sys.argv += ["--process", index]
            printed = os.open(f"printed{index}", os.O_CREAT | os.O_WRONLY)
            for stream in (1, 2):
                os.dup2(printed, stream)
            sys.exit(main())
    sys.exit(any([os.wait()[1] for _ in "01"]))
