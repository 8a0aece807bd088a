"""MuJoCo's steps without its stopwatch and its warnings.

Reason: MuJoCo's Python package times each stage of each step (`MjData.timer`), which takes a tenth of a small
robot's step, and has no way to switch that off: `mujoco.set_mjcb_time(None)` restores its clock. Only C can
remove it.
Upstream: the timers were asked for in https://github.com/google-deepmind/mujoco/issues/2354.
Remove it when `mujoco.set_mjcb_time(None)` leaves no clock: tests/envs/test_workarounds.py then fails.
"""

import ctypes
import threading
from typing import Any

import mujoco

_clock = ctypes.c_void_p.in_dll(ctypes.CDLL(mujoco._callbacks.__file__), "mjcb_time")


class _Undisturbed:
    """In this context MuJoCo's steps are not timed and write no warnings; both settings are process-wide.

    MuJoCo would write warnings of a diverging simulation to a file in the working directory. With several
    threads in the context, the first to enter changes the settings and the last to leave restores them.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._inside = 0
        self._before: tuple[int | None, Any] = (None, None)  # clock, handler of warnings

    def __enter__(self) -> None:
        with self._lock:
            if self._inside == 0:
                self._before = (_clock.value, mujoco.get_mju_user_warning())
                _clock.value = None
                mujoco.set_mju_user_warning(_ignore)
            self._inside += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                _clock.value, warning = self._before
                mujoco.set_mju_user_warning(warning)


def _ignore(_: str) -> None:
    pass


UNDISTURBED = _Undisturbed()
