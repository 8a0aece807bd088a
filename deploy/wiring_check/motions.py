"""The motions of the wiring check, and the joints' responses to them."""

import math

import numpy as np

from footfall.deploy.wiring_check.config import WiringCheckConfig

HEIGHT = 1.0 / 0.7698  # makes the maximum of `pulse` 1


def pulse(share: float) -> float:
    """Smooth motion to one side, to the other and back, for `share` from 0 to 1; amplitude 1."""
    if not 0.0 <= share <= 1.0:
        return 0.0
    return HEIGHT * math.sin(2.0 * math.pi * share) * math.sin(math.pi * share) ** 2


class Motions:
    """Offsets of joint targets: one joint after the other moves, and the others hold."""

    def __init__(self, amplitude_rad: np.ndarray, config: WiringCheckConfig) -> None:
        """Motions of n joints with amplitudes (n,), rad."""
        self._n, self._amplitude = len(amplitude_rad), amplitude_rad
        self._settle_s, self._move_s = config.settle_s, config.move_s
        self.duration_s = config.settle_s + self._n * config.move_s

    def offsets(self, time_s: float) -> np.ndarray:
        """Offsets from the initial pose, rad, (n,)."""
        offsets = np.zeros(self._n)
        since_s = time_s - self._settle_s
        joint = int(since_s // self._move_s)
        if since_s >= 0.0 and joint < self._n:
            offsets[joint] = self._amplitude[joint] * pulse(since_s / self._move_s - joint)
        return offsets

    def joint_at(self, time_s: float) -> int:
        """The joint that moves at a time; the first one before all motions and the last one after them."""
        return min(max(int((time_s - self._settle_s) // self._move_s), 0), self._n - 1)

    def responses(self, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Responses to all motions, (n, k), one row per moved joint (see `response`)."""
        return np.array([self.response(joint, time_s, values) for joint in range(self._n)])

    def response(self, joint: int, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Regression coefficients of each value on a joint's motion, per radian, (k,).

        A linear trend is removed first: it comes from slow swaying of the whole robot.

        Args:
            joint: the moved joint.
            time_s: (T,) times of the samples.
            values: (T, k).
        """
        begin_s = self._settle_s + joint * self._move_s
        first, last = np.searchsorted(time_s, [begin_s, self.end_s(joint)])
        share = (time_s[first:last] - begin_s) / self._move_s
        wave = self._amplitude[joint] * np.array([pulse(each) for each in share.tolist()])
        trend = np.vander(share, 2)
        wave = wave - trend @ np.linalg.lstsq(trend, wave, rcond=None)[0]
        response: np.ndarray = values[first:last].T @ wave / (wave @ wave)
        return response

    def end_s(self, joint: int) -> float:
        """End of a joint's motion, s."""
        return self._settle_s + joint * self._move_s + self._move_s
