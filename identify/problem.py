"""Residuals of a leg over windows, with the windows' starts eliminated."""

from dataclasses import dataclass

import numpy as np

from footfall.identify.differences import slopes_by_window
from footfall.identify.leg import FixedLeg
from footfall.identify.parameters import Parameter, nominal, values_of
from footfall.identify.robust import outlier_factor, robust_sigma
from footfall.identify.simulate import simulate
from footfall.identify.starts import Elimination, start_step
from footfall.identify.windows import Windows

START_SIGMA = np.array([0.003, 0.3])  # rad, rad/s: standard deviation of a window's estimated start
STEP_FRACTIONS = np.array([1.0, 0.3, 0.0])  # of a step of the starts: the best of these is taken
MIN_TORQUE_SIGMA_NM = 0.003  # minimum standard deviation of torque readings
BATCHES = 12  # number of batches per window for estimating the residuals' correlation


@dataclass
class Problem:
    """Least squares of one leg: residuals in units of their noise, parameters in units of their scales.

    The start of a window (2n numbers) is a nuisance parameter: at each linearisation it moves to its optimum,
    and its effect is taken out of the residuals (`starts.py`).
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
        self._elimination: Elimination | None = None

    def _shape(self) -> tuple[int, int]:
        """Numbers of windows and of residuals per window."""
        w, r, n = self.windows.position.shape
        return w, 2 * r * n

    @property
    def low(self) -> np.ndarray:
        return self.scaled(np.array([each.declaration.low for each in self.parameters]))

    @property
    def high(self) -> np.ndarray:
        return self.scaled(np.array([each.declaration.high for each in self.parameters]))

    def scaled(self, numbers: np.ndarray) -> np.ndarray:
        """Parameters (p,) in scales from nominal."""
        scale = np.array([each.declaration.scale for each in self.parameters])
        result: np.ndarray = (numbers - nominal(self.parameters)) / scale
        return result

    def numbers(self, x: np.ndarray) -> np.ndarray:
        """Parameters (p, K) in their own units, clipped: a solver may round a bound to just beyond it."""
        kinds = [each.declaration for each in self.parameters]
        scale, low, high = (
            np.array([getattr(kind, name) for kind in kinds]) for name in ("scale", "low", "high")
        )
        result: np.ndarray = nominal(self.parameters)[:, None] + scale[:, None] * x
        return result.clip(low[:, None], high[:, None])

    def errors(self, x: np.ndarray, start: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Predicted minus measured positions, rad, and torques, N m, for candidates (p, K): (K, W, R, n)."""
        count = x.shape[1]
        fixed = tuple(self.fixed)
        fixed_values = np.array(list(self.fixed.values())).reshape(-1, 1) * np.ones(count)
        numbers = np.concatenate([self.numbers(x), fixed_values])
        values = values_of(self.leg, (*self.parameters, *fixed), numbers)
        starts = np.broadcast_to(self.start, (count, *self.start.shape)) if start is None else start
        prediction = simulate(self.leg, self.windows, values, starts)
        return prediction.position - self.windows.position, prediction.torque - self.windows.torque

    def _residuals(self, x: np.ndarray, start: np.ndarray | None = None) -> np.ndarray:
        """Weighted residuals, (K, W, m)."""
        position, torque = self.errors(x, start)
        stacked = np.concatenate(
            [position / self.position_sigma, np.nan_to_num(torque / self.torque_sigma)], axis=2
        )
        result: np.ndarray = stacked.reshape(*stacked.shape[:2], -1) * self.weight
        return result

    def refine_starts(self, x: np.ndarray) -> None:
        """Move each window's start to its optimum at `x`, (p,), and take its effect out of the residuals.

        If a joint sticks, the cost has several minima. So a step begins at the estimated start where its cost
        is lower than that of the current start. A step that does not reduce the cost is shortened.
        """
        self._elimination = None
        choices = np.stack([self.start, self.windows.start])
        self.start = _best(choices, self._start_costs(x, choices))
        w, _, n = self.start.shape
        step = start_step(
            lambda starts: self._residuals(
                np.repeat(x[:, None], len(starts), axis=1), starts.reshape(-1, w, 2, n)
            ),
            self.start.reshape(w, -1),
            self.windows.start.reshape(w, -1),
            np.repeat(START_SIGMA, n),
            np.ones((w, 1)),
        )
        moved = self.start + STEP_FRACTIONS[:, None, None, None] * step.move.reshape(w, 2, n)
        self.start = _best(moved, self._start_costs(x, moved))
        self._elimination = step.elimination

    def _start_costs(self, x: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Cost of each window with its start, (C, W), for C choices of starts (C, W, 2, n)."""
        residuals = self._residuals(np.repeat(x[:, None], len(start), axis=1), start)
        deviation = (start - self.windows.start) / START_SIGMA[:, None]
        costs: np.ndarray = (residuals**2).sum(axis=2) + (deviation**2).sum(axis=(2, 3))
        return costs

    def reweight(self, x: np.ndarray) -> None:
        """Set the weights from the residuals at `x`, (p,): less for outliers and correlated residuals.

        The deviation of the torque errors replaces `torque_sigma`.

        The readings of a joint that hardly moves all have the same rounding error: a hundred of them carry no
        more information than one.
        """
        self.weight = np.ones(self._shape())
        _, torque = self.errors(x[:, None])
        deviation = robust_sigma(np.nan_to_num(torque), axis=(0, 1, 2))
        used = np.isfinite(self.torque_sigma)
        self.torque_sigma = np.where(used, np.maximum(deviation, MIN_TORQUE_SIGMA_NM), np.inf)
        residuals = self._residuals(x[:, None])[0]
        sigma = float(robust_sigma(residuals[residuals != 0.0])) if residuals.any() else 1.0
        w, rows, n = self.windows.position.shape
        correlation = np.sqrt(_correlation_times(residuals.reshape(w, 2, rows, n)))
        self.weight = 1.0 / (
            outlier_factor(residuals, sigma) * np.broadcast_to(correlation, (w, 2, rows, n)).reshape(w, -1)
        )

    def by_window(self, x: np.ndarray) -> np.ndarray:
        """Residuals without the effect of the starts, (K, W, m), for candidates (p, K)."""
        residuals = self._residuals(x)
        return residuals if self._elimination is None else self._elimination.apply(residuals)

    def slopes(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals by window, (W, m), and their derivatives, (W, m, p), at x."""
        return slopes_by_window(self.by_window, x, self.high)

    def residual(self, x: np.ndarray) -> np.ndarray:
        """Function for `mujoco.minimize`: residuals (residuals, K) of candidates (p, K)."""
        residuals = self.by_window(x)
        return residuals.reshape(len(residuals), -1).T


def _correlation_times(residual: np.ndarray) -> np.ndarray:
    """Number of residuals, at least 1, that carry the information of one independent residual, (W, 2, 1, n).

    From the variance of batch means, which is inversely proportional to a batch's length if residuals are
    independent.

    Args:
        residual: residuals of positions and torques, (W, 2, R, n).
    """
    w, kinds, rows, n = residual.shape
    length = max(1, rows // BATCHES)
    batches = residual[:, :, : rows // length * length].reshape(w, kinds, -1, length, n)
    mean_squares = (batches.mean(axis=3) ** 2).mean(axis=2)
    squares = (batches**2).mean(axis=(2, 3))
    ratio = length * mean_squares / np.where(squares > 0.0, squares, 1.0)
    result: np.ndarray = np.maximum(ratio, 1.0)[:, :, None]
    return result


def _best(choices: np.ndarray, costs: np.ndarray) -> np.ndarray:
    """The choice with the lowest cost for each window, from (C, W, ...) and costs (C, W)."""
    best: np.ndarray = choices[costs.argmin(axis=0), np.arange(choices.shape[1])]
    return best
