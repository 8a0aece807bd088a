"""Least squares for a leg: Gauss-Newton steps, with starts and weights refined between them."""

from dataclasses import replace

import numpy as np
from mujoco import minimize

from footfall.identify.problem import Problem

DIFFERENCE_STEP = 1e-4  # step of finite differences, in scales
MAX_STEP = 3.0  # of a round, in scales
CONVERGED_STEP = 3e-3  # maximum step of a converged fit, in scales
UNWEIGHTED_ROUNDS = 2  # rounds before outliers get less weight
COARSE_INTERVAL = 3  # interval of the windows used at first


def solve(problem: Problem, rounds: int, x: np.ndarray) -> np.ndarray:
    """Solution of a fit that starts at x, (p,): first with some of the windows, then with all."""
    coarse = coarsened(problem)
    if coarse is not problem:
        x = gauss_newton(coarse, rounds // 2, x)
    return gauss_newton(problem, rounds, x)


def coarsened(problem: Problem) -> Problem:
    """The problem with every `COARSE_INTERVAL`-th window; unchanged if it has few."""
    width = problem.windows.width
    if width < COARSE_INTERVAL * COARSE_INTERVAL:
        return problem
    return replace(problem, windows=problem.windows.take(np.arange(width) % COARSE_INTERVAL == 0))


def gauss_newton(problem: Problem, rounds: int, x: np.ndarray) -> np.ndarray:
    """At most `rounds` steps from x, (p,), with starts and weights refined before each step."""
    problem.refine_starts(x)
    for round_index in range(rounds):
        if round_index >= UNWEIGHTED_ROUNDS:
            problem.reweight(x)
        problem.refine_starts(x)
        solution, _ = minimize.least_squares(
            x,
            problem.residual,
            [np.maximum(problem.low, x - MAX_STEP), np.minimum(problem.high, x + MAX_STEP)],
            eps=DIFFERENCE_STEP,
            max_iter=1,
            mu_min=1e-4,
            mu_factor=10.0,
            x_scale="jac",
            verbose=minimize.Verbosity.SILENT,
        )
        max_change, x = float(np.abs(solution - x).max()), solution
        if round_index > UNWEIGHTED_ROUNDS and max_change < CONVERGED_STEP:
            break
    problem.refine_starts(x)
    return x
