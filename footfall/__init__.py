"""footfall: legged robots, from a description to a policy on motors. The command line is in `cli`."""

import time

IMPORTED_AT_NS = time.time_ns()  # no module of ours is older in this process
