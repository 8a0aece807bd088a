"""MJX, imported without its two lines on stdout about Warp, which it goes without here.

They are printed by `mujoco/mjx/warp/__init__.py` where the package `warp` is not installed. This can go when
`envs/test_quiet_mjx.py` says that MJX is quiet by itself.
"""

import io
from contextlib import redirect_stdout

with redirect_stdout(io.StringIO()):
    from mujoco import mjx

__all__ = ["mjx"]
