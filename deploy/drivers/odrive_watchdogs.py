"""Watchdogs of ODrive axes: each is read before its axis is enabled, if robot.yaml has its endpoints."""

import numpy as np

from footfall.deploy.drivers import odrive
from footfall.deploy.wiring import Wiring


class Watchdogs:
    """Watchdogs of n axes."""

    def __init__(self, wiring: Wiring) -> None:
        self._wiring = wiring
        self._endpoints = wiring.watchdog_endpoints.T  # (2, n): enable and time; 0 for none
        self._known = np.full(self._endpoints.shape, np.nan)  # enabled, and time in s; NaN: unknown

    def due_reads(self) -> tuple[np.ndarray, np.ndarray]:
        """Axes (k,) with an unknown endpoint, and the first such endpoint of each, (k,)."""
        unknown = np.isnan(self._known) & (self._endpoints > 0)
        axes = np.flatnonzero(unknown.any(axis=0))
        return axes, self._endpoints[unknown[:, axes].argmax(axis=0), axes]

    def note(self, motor: np.ndarray, data: np.ndarray) -> None:
        """Store frames (k, 8) of axes (k,) with values: enable in byte 4, or a time in bytes 4 to 7."""
        endpoint, (_, number) = odrive.endpoint_of(data), odrive.floats(data)
        is_enable, is_timeout = (endpoint == self._endpoints[row, motor] for row in (0, 1))
        self._known[0, motor[is_enable]] = data[is_enable, 4] != 0
        self._known[1, motor[is_timeout]] = number[is_timeout]

    def problem(self) -> str:
        """First axis whose watchdog does not permit enabling it, with the reason; empty if all permit it."""
        longest_s, declared = self._wiring.timeout_s, self._endpoints[0] > 0
        enabled, timeout_s = self._known
        for wrong, what in (
            (np.isnan(enabled + timeout_s), "has not reported its watchdog (check watchdog_endpoints)"),
            (enabled == 0.0, "has its watchdog disabled (set enable_watchdog)"),
            (~_within(timeout_s, longest_s), "has a watchdog of {0:g} s (set watchdog_timeout to {1:g})"),
        ):
            if (wrong & declared).any():
                joint = int((wrong & declared).argmax())
                return f"motor {self._wiring.label(joint)} {what.format(timeout_s[joint], longest_s[joint])}"
        return ""


def _within(time_s: np.ndarray, longest_s: np.ndarray) -> np.ndarray:
    """Times (n,), rounded to 4-byte floats, above 0 and at most the given ones."""
    return (time_s > 0.0) & (time_s <= longest_s * (1.0 + 1e-6))
