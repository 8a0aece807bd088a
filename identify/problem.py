"""Residuals of a leg over windows, with the windows' starts eliminated."""

from dataclasses import dataclass

import numpy as np

from footfall.identify.differences import slopes_by_window
from footfall.identify.leg import FixedLeg
from footfall.identify.parameters import Parameter, nominal, values_of
from footfall.identify.simulate import simulate
from footfall.identify.windows import Windows

START_SIGMA = np.array([0.003, 0.3])  # rad, rad/s: standard deviation of a window's estimated start
SHARES = np.array([1.0, 0.3, 0.0])  # of a step of the starts: those that are tested
LEAST_TORQUE_NM = 0.003  # minimum standard deviation of torque readings
NORMAL_MEDIAN = 0.6745  # median of the absolute values of a normal distribution, in standard deviations
BATCHES = 12  # number of batches per window for estimating the residuals' correlation
OUTLIER = 3.0  # in robust standard deviations: larger residuals get less weight


@dataclass
class Problem:
    """Least squares of one leg: residuals in units of their noise, parameters in units of their scales.

    A window's start (2n numbers) is a nuisance: at each linearisation it is moved to its best value and the
    residuals are projected onto what no start explains (variable projection, Golub and Pereyra 1973).
    """

    leg: FixedLeg
    windows: Windows
    parameters: tuple[Parameter, ...]  # free parameters
    fixed: dict[Parameter, float]  # other parameters that are not nominal
    position_sigma: np.ndarray  # (n,) rad
    torque_sigma: np.ndarray  # (n,) N m; infinite if torque is not used

    def __post_init__(self) -> None:
        self.start = self.windows.start.copy()  # (W, 2, n)
        self.weight = np.ones(self._shape())
        self._project: tuple[np.ndarray, np.ndarray] | None = (
            None  # slopes by the starts, their pseudo-inverse
        )

    def _shape(self) -> tuple[int, int]:
        """Numbers of windows and of residuals per window."""
        w, r, n = self.windows.position.shape
        return w, 2 * r * n

    @property
    def low(self) -> np.ndarray:
        return self.scaled(np.array([each.kind.low for each in self.parameters]))

    @property
    def high(self) -> np.ndarray:
        return self.scaled(np.array([each.kind.high for each in self.parameters]))

    def scaled(self, numbers: np.ndarray) -> np.ndarray:
        """Parameters (p,) in scales from nominal."""
        scale = np.array([each.kind.scale for each in self.parameters])
        result: np.ndarray = (numbers - nominal(self.parameters)) / scale
        return result

    def numbers(self, x: np.ndarray) -> np.ndarray:
        """Parameters (p, K) in their own units."""
        scale = np.array([each.kind.scale for each in self.parameters])
        result: np.ndarray = nominal(self.parameters)[:, None] + scale[:, None] * x
        return result

    def errors(self, x: np.ndarray, start: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Predicted minus measured positions, rad, and torques, N m: (K, W, R, n) each, for candidates (p,
        K)."""
        count = x.shape[1]
        fixed = tuple(self.fixed)
        known = np.array(list(self.fixed.values())).reshape(-1, 1) * np.ones(count)
        numbers = np.concatenate([self.numbers(x), known])
        values = values_of(self.leg, (*self.parameters, *fixed), numbers)
        begin = np.broadcast_to(self.start, (count, *self.start.shape)) if start is None else start
        found = simulate(self.leg, self.windows, values, begin)
        return found.position - self.windows.position, found.torque - self.windows.torque

    def _residuals(self, x: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """Weighted residuals, (K, W, m)."""
        position, torque = self.errors(x, start)
        stacked = np.concatenate(
            [position / self.position_sigma, np.nan_to_num(torque / self.torque_sigma)], axis=2
        )
        result: np.ndarray = stacked.reshape(*stacked.shape[:2], -1) * self.weight
        return result

    def refine_starts(self, x: np.ndarray) -> None:
        """Move each window's start to its best value at `x`, (p,), and take it out of the residuals.

        A joint that sticks has several best starts: a step begins at the estimated start again where that
        is better by now, and is shortened where it does not help.
        """
        n, eps = self.leg.count, 1e-3
        self._project = None
        w, _ = self._shape()
        columns = 2 * n
        both = np.stack([self.start, self.windows.start])
        self.start = _best(both, self._start_costs(x, both))
        start = np.repeat(self.start[None], columns + 1, axis=0)
        sigma = np.repeat(START_SIGMA, n)
        for column in range(columns):
            start[column + 1, :, column // n, column % n] += eps * sigma[column]
        found = self._residuals(np.repeat(x[:, None], columns + 1, axis=1), start)
        slope = np.moveaxis((found[1:] - found[0]) / eps, 0, 2)  # (W, m, 2n), per sigma
        now = ((self.start - self.windows.start) / START_SIGMA[:, None]).reshape(w, columns)
        normal = np.einsum("wmi,wmj->wij", slope, slope) + np.eye(columns)
        gradient = np.einsum("wmi,wm->wi", slope, found[0]) + now
        move = -np.linalg.solve(normal, gradient[..., None])[..., 0]
        moved = self.start + SHARES[:, None, None, None] * (move * sigma).reshape(w, 2, n)
        self.start = _best(moved, self._start_costs(x, moved))
        self._project = np.einsum("wmi,wij->wmj", slope, np.linalg.inv(normal)), slope

    def _start_costs(self, x: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Squared residuals of windows and their starts, (C, W), for C choices of starts (C, W, 2, n)."""
        found = self._residuals(np.repeat(x[:, None], len(start), axis=1), start)
        away = (start - self.windows.start) / START_SIGMA[:, None]
        costs: np.ndarray = (found**2).sum(axis=2) + (away**2).sum(axis=(2, 3))
        return costs

    def reweight(self, x: np.ndarray) -> None:
        """Let torques count by their residuals at `x`, (p,); outliers less, and residuals that repeat others.

        The reading of a joint that hardly moves keeps its rounding error: a hundred of them tell no more
        than one.
        """
        self.weight = np.ones(self._shape())
        _, torque = self.errors(x[:, None])
        deviation = np.median(np.abs(np.nan_to_num(torque)), axis=(0, 1, 2)) / NORMAL_MEDIAN
        told = np.isfinite(self.torque_sigma)
        self.torque_sigma = np.where(told, np.maximum(deviation, LEAST_TORQUE_NM), np.inf)
        found = self._residuals(x[:, None])[0]
        size = np.median(np.abs(found[found != 0.0])) / NORMAL_MEDIAN if found.any() else 1.0
        outlying = np.sqrt(1.0 + (found / (OUTLIER * max(size, 1.0))) ** 2)
        w, rows, n = self.windows.position.shape
        repeated = np.sqrt(_correlation_times(found.reshape(w, 2, rows, n)))
        self.weight = 1.0 / (outlying * np.broadcast_to(repeated, (w, 2, rows, n)).reshape(w, -1))

    def by_window(self, x: np.ndarray) -> np.ndarray:
        """Projected residuals, (K, W, m), for candidates (p, K)."""
        found = self._residuals(x)
        if self._project is None:
            return found
        back, slope = self._project
        along = np.einsum("wmi,kwm->kwi", slope, found)
        result: np.ndarray = found - np.einsum("wmi,kwi->kwm", back, along)
        return result

    def slopes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals by window, (W, m), and their derivatives, (W, m, p), at x."""
        return slopes_by_window(self.by_window, x, self.high)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Function for `mujoco.minimize`: residuals (residuals, K) of candidates (p, K)."""
        found = self.by_window(x)
        return found.reshape(len(found), -1).T


def _correlation_times(residual: np.ndarray) -> np.ndarray:
    """Residuals that tell as much as one independent one, at least 1, (W, 2, 1, n), of (W, 2, R, n).

    By the variance of means over batches: of independent residuals it falls with the batch's length.
    """
    w, kinds, rows, n = residual.shape
    length = max(1, rows // BATCHES)
    whole = residual[:, :, : rows // length * length].reshape(w, kinds, -1, length, n)
    of_means = (whole.mean(axis=3) ** 2).mean(axis=2)
    of_all = (whole**2).mean(axis=(2, 3))
    ratio = length * of_means / np.where(of_all > 0.0, of_all, 1.0)
    result: np.ndarray = np.maximum(ratio, 1.0)[:, :, None]
    return result


def _best(choices: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """The choice with the lowest cost for each window, from (C, W, ...) and costs (C, W)."""
    best: np.ndarray = choices[costs.argmin(axis=0), np.arange(choices.shape[1])]
    return best
