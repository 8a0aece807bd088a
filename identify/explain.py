"""Finds an effect that would explain a misfit, by fitting again with each effect."""

from dataclasses import dataclass, replace

import numpy as np

from footfall.identify.parameters import EFFECTS, parameters_of
from footfall.identify.problem import Problem
from footfall.identify.solver import some_windows, stepped

ROUNDS = 5
CLEAR = 0.7  # an effect is named if it reduces a residual to less than this share


@dataclass(frozen=True)
class Explanation:
    """Residual of positions relative to their noise for the worst joint, without effects and with each
    one."""

    without: float
    with_effect: dict[str, float]

    @property
    def best(self) -> str | None:
        """The effect that explains most; None if no effect explains enough."""
        name, left = min(self.with_effect.items(), key=lambda each: each[1])
        return name if left < CLEAR * self.without else None


def explained(problem: Problem, x: np.ndarray, rounds: int = ROUNDS) -> Explanation:
    """Fit again with each effect, using some of the windows.

    Args:
        problem: of the fit.
        x: its solution, (p,).
        rounds: of each fit.
    """
    few = some_windows(problem)
    found = {name: _ratio(few, x, name, rounds) for name in EFFECTS if not _has(problem, name)}
    return Explanation(_ratio(few, x, None, rounds), found)


def _has(problem: Problem, name: str) -> bool:
    return any(each.quantity == name for each in problem.parameters)


def _ratio(problem: Problem, x: np.ndarray, effect: str | None, rounds: int) -> float:
    """Residual relative to noise of the worst joint, with one additional effect."""
    names = () if effect is None else (effect,)
    extra = [each for each in parameters_of(problem.leg, names) if each.quantity in names]
    wider = replace(problem, parameters=(*extra, *problem.parameters))
    x = stepped(wider, rounds, np.concatenate([np.zeros(len(extra)), x]))
    errors, _ = wider.errors(x[:, None])
    return float((np.sqrt((errors**2).mean(axis=(0, 1, 2))) / problem.position_sigma).max())
