"""Least squares for a leg: Gauss-Newton steps, with starts and weights refined between them."""

from dataclasses import replace

import numpy as np
from mujoco import minimize

from footfall.identify.problem import Problem

STEP = 1e-4  # of finite differences, in scales
LONGEST_STEP = 3.0  # maximum step of a round, in scales
SETTLED = 3e-3  # maximum step of a converged fit, in scales
UNWEIGHTED = 2  # rounds before outliers get less weight
COARSE = 3  # interval of the windows used at first


def solve(problem: Problem, rounds: int, x: np.ndarray) -> np.ndarray:
    """Gauss-Newton from x; starts and weights are refined before each step; with fewer windows at first."""
    coarse = some_windows(problem)
    if coarse is not problem:
        x = stepped(coarse, rounds // 2, x)
    return stepped(problem, rounds, x)


def some_windows(problem: Problem) -> Problem:
    """The problem with every `COARSE`-th window; unchanged if it has few."""
    width = problem.windows.width
    if width < COARSE * COARSE:
        return problem
    return replace(problem, windows=problem.windows.take(np.arange(width) % COARSE == 0))


def stepped(problem: Problem, rounds: int, x: np.ndarray) -> np.ndarray:
    """At most `rounds` steps; fewer if they converge."""
    problem.refine_starts(x)
    for turn in range(rounds):
        if turn >= UNWEIGHTED:
            problem.reweight(x)
        problem.refine_starts(x)
        found, _ = minimize.least_squares(
            x,
            problem.residual,
            [np.maximum(problem.low, x - LONGEST_STEP), np.minimum(problem.high, x + LONGEST_STEP)],
            eps=STEP,
            max_iter=1,
            mu_min=1e-4,
            mu_factor=10.0,
            x_scale="jac",
            verbose=minimize.Verbosity.SILENT,
        )
        moved, x = float(np.abs(found - x).max()), found
        if turn > UNWEIGHTED and moved < SETTLED:
            break
    problem.refine_starts(x)
    return x
