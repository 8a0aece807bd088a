"""The command line: parses options and hands over to the room that a verb needs."""

import time

IMPORTED_AT_NS = time.time_ns()  # no module of ours is older in this process
