"""Least squares of any simulator over windows of recorded motion, each simulated from its own start.

A window's start is a nuisance parameter: at each linearisation it moves to its optimum under a prior, and its
effect is taken out of the residuals (`starts.py`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from mujoco import minimize

from footfall.identify.differences import EPS, slopes_by_window
from footfall.identify.robust import outlier_factor, robust_sigma
from footfall.identify.starts import Elimination, start_step

Simulate = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Motion of K candidates: parameters (p, K) and starts (K, W, s) to readings (K, W, R, c)."""

START_ROUNDS = 2  # Gauss-Newton steps of the starts before an evaluation


class FitParameter(NamedTuple):
    """One parameter of a fit."""

    name: str
    unit: str
    guess: float
    low: float
    high: float
    scale: float  # typical difference between two robots


@dataclass(frozen=True)
class Shooting:
    """W windows of recordings, and the parameters of a fit."""

    simulate: Simulate
    parameters: tuple[FitParameter, ...]
    measured: np.ndarray  # (W, R, c); NaN without a reading
    sigma: np.ndarray  # (c,) standard deviation of a reading, the unit of residuals
    start: np.ndarray  # (W, s) estimated
    start_sigma: np.ndarray  # (s,) standard deviation of that estimate
    recording: np.ndarray  # (W,) index of the recording of each window
    # (W,); empty: all recordings have the same weight.
    window_weight: np.ndarray = field(default_factory=lambda: np.ones(0))
    # (W, R, c), less for outliers; empty: ones.
    point_weight: np.ndarray = field(default_factory=lambda: np.ones(0))

    @property
    def recordings(self) -> np.ndarray:
        """Indices of the windows' recordings."""
        return np.unique(self.recording)

    @property
    def guess(self) -> np.ndarray:
        """Initial values of the parameters, (p,)."""
        return np.array([each.guess for each in self.parameters])

    @property
    def bounds(self) -> list[np.ndarray]:
        """Bounds of the scaled parameters, (p,) each."""
        limits = np.array([(each.low, each.high) for each in self.parameters])
        return [self.scaled(limits[:, 0]), self.scaled(limits[:, 1])]

    def scaled(self, numbers: np.ndarray) -> np.ndarray:
        """Convert parameters (p,) or (p, K) to differences from their initial values, in scales."""
        centre, scale = self._centre_and_scale(numbers.ndim)
        result: np.ndarray = (numbers - centre) / scale
        return result

    def unscaled(self, x: np.ndarray) -> np.ndarray:
        """Inverse of `scaled`."""
        centre, scale = self._centre_and_scale(x.ndim)
        result: np.ndarray = centre + scale * x
        return result

    def _centre_and_scale(self, ndim: int) -> tuple[np.ndarray, np.ndarray]:
        shape = (-1,) + (1,) * (ndim - 1)
        return self.guess.reshape(shape), np.array([each.scale for each in self.parameters]).reshape(shape)

    def of(self, recordings: Sequence[int] | np.ndarray, excluded: np.ndarray | None = None) -> "Shooting":
        """The same fit with weight on some recordings only.

        Args:
            recordings: indices of recordings; all have the same weight, whatever their length. A recording
                that is listed twice counts twice.
            excluded: (W,) true for windows that do not count.
        """
        repeats = np.bincount(np.asarray(recordings), minlength=int(self.recording.max()) + 1)
        kept = repeats[self.recording] * (1.0 if excluded is None else ~excluded)
        sizes = np.bincount(self.recording, weights=kept > 0.0, minlength=len(repeats))
        weight = kept / np.maximum(sizes, 1.0)[self.recording]
        return replace(self, window_weight=weight / weight.sum() * (weight > 0.0).sum())

    def with_fixed(self, name: str, value: float) -> "Shooting":
        """Return the same fit with one parameter fixed."""
        row = [each.name for each in self.parameters].index(name)
        simulate, rest = self.simulate, self.parameters[:row] + self.parameters[row + 1 :]

        def simulate_fixed(numbers: np.ndarray, start: np.ndarray) -> np.ndarray:
            return simulate(np.insert(numbers, row, value, axis=0), start)

        return replace(self, simulate=simulate_fixed, parameters=rest)

    @property
    def weight(self) -> np.ndarray:
        """Weights of the windows, (W,); the mean of the positive weights is 1."""
        return self.window_weight if self.window_weight.size else self.of(self.recordings).window_weight

    def errors(self, numbers: np.ndarray) -> np.ndarray:
        """Simulated minus measured readings, (W, R, c), with optimal starts."""
        moved = self
        for _ in range(START_ROUNDS):
            moved, _ = moved._with_better_starts(self.scaled(numbers), self.start)
        simulated = self.simulate(numbers[:, None], moved.start[None])[0]
        result: np.ndarray = simulated - self.measured
        return result

    def fit(self, initial: np.ndarray | None = None, rounds: int = 3, iterations: int = 8) -> np.ndarray:
        """Least-squares estimate of the parameters, (p,).

        Args:
            initial: initial parameters, (p,).
            rounds: number of refinements of starts and of outliers' weights.
            iterations: maximum number of Gauss-Newton steps in a round.
        """
        x = self.scaled(self.guess if initial is None else initial)
        current = self
        for _ in range(rounds):
            current, elimination = current._with_better_starts(x, self.start)
            current = current._reweighted(x)
            current, elimination = current._with_better_starts(x, self.start)
            x, _ = minimize.least_squares(
                x,
                lambda candidates, current=current, elimination=elimination: current._stacked(
                    candidates, elimination
                ),
                self.bounds,
                eps=EPS,
                max_iter=iterations,
                xtol=1e-5,
                verbose=minimize.Verbosity.SILENT,
            )
        return self.unscaled(x)

    def linearised(self, numbers: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Function of scaled candidates near `numbers`, (p, K), that returns residuals, (K, W, m).

        The effect of the starts is taken out of the residuals.
        """
        x, current = self.scaled(numbers), self
        for _ in range(START_ROUNDS):
            current, elimination = current._with_better_starts(x, self.start)
        return lambda candidates: current._without_starts(candidates, elimination)

    def slopes(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals by window, (W, m), and their derivatives by scaled parameters, (W, m, p)."""
        return slopes_by_window(self.linearised(numbers), self.scaled(numbers), self.bounds[1])

    def _residuals(self, x: np.ndarray, start: np.ndarray) -> np.ndarray:
        """Weighted residuals, (K, W, m)."""
        error = (self.simulate(self.unscaled(x), start) - self.measured) / self.sigma
        if self.point_weight.size:
            error = error * self.point_weight
        flat = np.nan_to_num(error).reshape(*error.shape[:2], -1)
        result: np.ndarray = flat * np.sqrt(self.weight)[:, None]
        return result

    def _with_better_starts(self, x: np.ndarray, prior: np.ndarray) -> tuple["Shooting", Elimination]:
        """One Gauss-Newton step of all starts at x, (p,)."""
        weight = np.maximum(self.weight, 1e-12)[:, None]
        step = start_step(
            lambda starts: self._residuals(np.repeat(x[:, None], len(starts), axis=1), starts),
            self.start,
            prior,
            self.start_sigma,
            weight,
        )

        def cost(residuals: np.ndarray, start: np.ndarray) -> np.ndarray:
            deviation = (start - prior) / self.start_sigma
            result: np.ndarray = (residuals**2).sum(axis=1) + (weight * deviation**2).sum(axis=1)
            return result

        moved = self.start + step.move
        residuals = self._residuals(x[:, None], moved[None])[0]
        # A step can increase the cost: a sticking joint has no derivative.
        better = cost(residuals, moved) < cost(step.residuals, self.start)
        return replace(self, start=np.where(better[:, None], moved, self.start)), step.elimination

    def _reweighted(self, x: np.ndarray) -> "Shooting":
        """Reduce the weight of outliers (Cauchy loss)."""
        error = (self.simulate(self.unscaled(x[:, None]), self.start[None])[0] - self.measured) / self.sigma
        known = np.isfinite(error) & (self.weight > 0.0)[:, None, None]
        factor = outlier_factor(np.nan_to_num(error), float(robust_sigma(error[known])))
        return replace(self, point_weight=1.0 / factor)

    def _without_starts(self, x: np.ndarray, elimination: Elimination) -> np.ndarray:
        """Residuals without the effect of the starts, (K, W, m), for candidates (p, K)."""
        return elimination.apply(
            self._residuals(x, np.broadcast_to(self.start, (x.shape[1], *self.start.shape)))
        )

    def _stacked(self, x: np.ndarray, elimination: Elimination) -> np.ndarray:
        """Function for `mujoco.minimize`: residuals (residuals, K) of candidates (p, K)."""
        residuals = self._without_starts(x, elimination)
        return residuals.reshape(len(residuals), -1).T
