"""MJX, imported without its two lines on stdout about Warp, which is not used here.

`mujoco/mjx/warp/__init__.py` prints them if the package `warp` is not installed. Remove this module when
MJX is quiet by itself; `tests/envs/test_workarounds.py` fails for a release that was not tried.
"""

import io
from contextlib import redirect_stdout

with redirect_stdout(io.StringIO()):
    from mujoco import mjx

__all__ = ["mjx"]
