"""Least squares of any simulator over windows of recorded motion, each simulated from its own start.

A window's start is a nuisance: at each linearisation it moves to its best value under a prior, and residuals
are projected onto what no start explains (variable projection, Golub and Pereyra 1973).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from mujoco import minimize

from footfall.identify.differences import EPS, slopes_by_window

Simulate = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Motion of K candidates: parameters (p, K) and starts (K, W, s) to readings (K, W, R, c)."""

OUTLIER = 3.0  # in robust standard deviations: larger residuals get less weight
START_ROUNDS = 2  # Gauss-Newton steps of the starts before an evaluation


class Number(NamedTuple):
    """One parameter of a fit."""

    name: str
    unit: str
    guess: float
    low: float
    high: float
    scale: float  # typical difference between two machines


@dataclass(frozen=True)
class Shooting:
    """W windows of recordings, and the parameters of a fit."""

    simulate: Simulate
    numbers: tuple[Number, ...]
    measured: np.ndarray  # (W, R, c); NaN without a reading
    sigma: np.ndarray  # (c,) standard deviation of a reading, the unit of residuals
    start: np.ndarray  # (W, s) estimated
    start_sigma: np.ndarray  # (s,) standard deviation of that estimate
    recording: np.ndarray  # (W,) index of the recording of each window
    window_weight: np.ndarray = field(
        default_factory=lambda: np.ones(0)
    )  # (W,); empty: recordings count alike
    point_weight: np.ndarray = field(default_factory=lambda: np.ones(0))  # (W, R, c) of outliers; empty: ones

    @property
    def recordings(self) -> np.ndarray:
        """Indices of the windows' recordings."""
        return np.unique(self.recording)

    @property
    def guess(self) -> np.ndarray:
        """Initial values of the parameters, (p,)."""
        return np.array([each.guess for each in self.numbers])

    @property
    def bounds(self) -> list[np.ndarray]:
        """Bounds of the scaled parameters, (p,) each."""
        ends = np.array([(each.low, each.high) for each in self.numbers])
        return [self.scaled(ends[:, 0]), self.scaled(ends[:, 1])]

    def scaled(self, numbers: np.ndarray) -> np.ndarray:
        """Convert parameters (p,) or (p, K) to differences from their initial values, in scales."""
        centre, scale = self._frame(numbers.ndim)
        result: np.ndarray = (numbers - centre) / scale
        return result

    def unscaled(self, x: np.ndarray) -> np.ndarray:
        """Inverse of `scaled`."""
        centre, scale = self._frame(x.ndim)
        result: np.ndarray = centre + scale * x
        return result

    def _frame(self, ndim: int) -> tuple[np.ndarray, np.ndarray]:
        shape = (-1,) + (1,) * (ndim - 1)
        return self.guess.reshape(shape), np.array([each.scale for each in self.numbers]).reshape(shape)

    def of(self, recordings: Sequence[int] | np.ndarray, without: np.ndarray | None = None) -> "Shooting":
        """The same with weight on some recordings only; one that is named twice counts twice.

        Args:
            recordings: that count, each alike, however long it is.
            without: (W,) true for windows of them that do not count.
        """
        times = np.bincount(np.asarray(recordings), minlength=int(self.recording.max()) + 1)
        kept = times[self.recording] * (1.0 if without is None else ~without)
        sizes = np.bincount(self.recording, weights=kept > 0.0, minlength=len(times))
        weight = kept / np.maximum(sizes, 1.0)[self.recording]
        return replace(self, window_weight=weight / weight.sum() * (weight > 0.0).sum())

    def held(self, name: str, value: float) -> "Shooting":
        """Return the same fit with one parameter fixed."""
        row = [each.name for each in self.numbers].index(name)
        simulate, rest = self.simulate, self.numbers[:row] + self.numbers[row + 1 :]

        def held(numbers: np.ndarray, start: np.ndarray) -> np.ndarray:
            return simulate(np.insert(numbers, row, value, axis=0), start)

        return replace(self, simulate=held, numbers=rest)

    @property
    def weight(self) -> np.ndarray:
        """Weights of the windows, (W,); their mean is one over the windows that count."""
        return self.window_weight if self.window_weight.size else self.of(self.recordings).window_weight

    def errors(self, numbers: np.ndarray) -> np.ndarray:
        """Simulated minus measured readings, (W, R, c), with the best starts."""
        moved = self
        for _ in range(START_ROUNDS):
            moved, _ = moved._with_best_starts(self.scaled(numbers), self.start)
        simulated = self.simulate(numbers[:, None], moved.start[None])[0]
        result: np.ndarray = simulated - self.measured
        return result

    def fit(self, first: np.ndarray | None = None, rounds: int = 3, iterations: int = 8) -> np.ndarray:
        """Least-squares estimate of the parameters, (p,); starts and outliers' weights are refined between
        rounds."""
        x = self.scaled(self.guess if first is None else first)
        now = self
        for _ in range(rounds):
            now, project = now._with_best_starts(x, self.start)
            now = now._reweighted(x)
            now, project = now._with_best_starts(x, self.start)
            x, _ = minimize.least_squares(
                x,
                lambda at, now=now, project=project: now._flat(at, project),
                self.bounds,
                eps=EPS,
                max_iter=iterations,
                xtol=1e-5,
                verbose=minimize.Verbosity.SILENT,
            )
        return self.unscaled(x)

    def linearised(self, numbers: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """Residuals (K, W, m) of scaled candidates (p, K) near `numbers`, with the starts taken out."""
        x, now = self.scaled(numbers), self
        for _ in range(START_ROUNDS):
            now, project = now._with_best_starts(x, self.start)
        return lambda candidates: now._projected(candidates, project)

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

    def _with_best_starts(
        self, x: np.ndarray, prior: np.ndarray
    ) -> tuple["Shooting", tuple[np.ndarray, np.ndarray]]:
        """One Gauss-Newton step of all starts at x, (p,); and what takes them out of residuals."""
        count = self.start.shape[1]
        start = np.repeat(self.start[None], count + 1, axis=0)
        for column in range(count):
            start[column + 1, :, column] += EPS * self.start_sigma[column]
        found = self._residuals(np.repeat(x[:, None], count + 1, axis=1), start)
        slope = np.moveaxis((found[1:] - found[0]) / EPS, 0, 2)  # (W, m, s), per sigma
        away = (self.start - prior) / self.start_sigma
        strength = np.maximum(self.weight, 1e-12)[:, None]  # of the prior, as of the window
        normal = np.einsum("wmi,wmj->wij", slope, slope) + strength[..., None] * np.eye(count)
        gradient = np.einsum("wmi,wm->wi", slope, found[0]) + strength * away
        moved = self.start - np.linalg.solve(normal, gradient[..., None])[..., 0] * self.start_sigma
        there = self._residuals(x[:, None], moved[None])[0]
        cost = (found[0] ** 2).sum(axis=1) + (strength * away**2).sum(axis=1)
        left = (there**2).sum(axis=1) + (strength * ((moved - prior) / self.start_sigma) ** 2).sum(axis=1)
        better = left < cost  # no derivative if a joint sticks
        back = np.einsum("wmi,wij->wmj", slope, np.linalg.inv(normal))
        return replace(self, start=np.where(better[:, None], moved, self.start)), (back, slope)

    def _reweighted(self, x: np.ndarray) -> "Shooting":
        """Reduce the weight of outliers (Cauchy loss)."""
        plain = replace(self, point_weight=np.ones(0))
        error = (self.simulate(self.unscaled(x[:, None]), self.start[None])[0] - self.measured) / plain.sigma
        known = np.isfinite(error) & (self.weight > 0.0)[:, None, None]
        size = float(np.median(np.abs(error[known]))) / 0.6745
        weight = 1.0 / np.sqrt(1.0 + (np.nan_to_num(error) / (OUTLIER * max(size, 1.0))) ** 2)
        return replace(self, point_weight=weight)

    def _projected(self, x: np.ndarray, project: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Residuals without the part explained by starts, (K, W, m), for candidates (p, K)."""
        found = self._residuals(x, np.broadcast_to(self.start, (x.shape[1], *self.start.shape)))
        back, slope = project
        along = np.einsum("wmi,kwm->kwi", slope, found)
        result: np.ndarray = found - np.einsum("wmi,kwi->kwm", back, along)
        return result

    def _flat(self, x: np.ndarray, project: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        found = self._projected(x, project)
        return found.reshape(len(found), -1).T
