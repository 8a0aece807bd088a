"""Finds the effect that explains a misfit, by repeating the fit with each effect."""

from dataclasses import dataclass, replace

import numpy as np

from footfall.identify.parameters import EFFECTS, parameters_of
from footfall.identify.problem import Problem
from footfall.identify.solver import coarsened, gauss_newton

ROUNDS = 5
MAX_REMAINING_SHARE = 0.7  # an effect is named if it reduces a residual to less than this share


@dataclass(frozen=True)
class Explanation:
    """Position residual over noise of the worst joint, without effects and with each effect."""

    without: float
    with_effect: dict[str, float]

    @property
    def best(self) -> str | None:
        """The effect with the smallest residual; None if no effect reduces it enough."""
        name, remaining = min(self.with_effect.items(), key=lambda each: each[1])
        return name if remaining < MAX_REMAINING_SHARE * self.without else None


def explained(problem: Problem, x: np.ndarray, rounds: int = ROUNDS) -> Explanation:
    """Fit again with each effect, using some of the windows.

    Args:
        problem: problem of the fit.
        x: solution of the fit, (p,).
        rounds: maximum number of Gauss-Newton steps of each fit.
    """
    coarse = coarsened(problem)
    ratios = {name: _ratio(coarse, x, name, rounds) for name in EFFECTS if not _has(problem, name)}
    return Explanation(_ratio(coarse, x, None, rounds), ratios)


def _has(problem: Problem, name: str) -> bool:
    return any(each.quantity == name for each in problem.parameters)


def _ratio(problem: Problem, x: np.ndarray, effect: str | None, rounds: int) -> float:
    """Residual relative to noise of the worst joint, with one additional effect."""
    names = () if effect is None else (effect,)
    extra = [each for each in parameters_of(problem.leg, names) if each.quantity in names]
    wider = replace(problem, parameters=(*extra, *problem.parameters))
    x = gauss_newton(wider, rounds, np.concatenate([np.zeros(len(extra)), x]))
    errors, _ = wider.errors(x[:, None])
    return float((np.sqrt((errors**2).mean(axis=(0, 1, 2))) / problem.position_sigma).max())
