"""Solution of a quadratic program in bounded time."""

from typing import Protocol

import daqp
import numpy as np
import piqp

_SOFT_INFINITY = 1e30


class QuadraticProgram(Protocol):
    """Minimise x' H x / 2 + g' x with lower <= (x[:k], rows x) <= upper.

    The first k bounds apply to variables, the others to the rows.
    """

    @property
    def hessian(self) -> np.ndarray: ...  # (variables, variables), positive definite

    @property
    def gradient(self) -> np.ndarray: ...  # (variables,)

    @property
    def rows(self) -> np.ndarray: ...  # (rows, variables)

    @property
    def lower(self) -> np.ndarray: ...  # (k + rows,), -1e30 without a bound

    @property
    def upper(self) -> np.ndarray: ...  # (k + rows,)


class BoundedSolver:
    """Runs daqp with an iteration limit, then PIQP.

    An active-set method is by far the fastest if few constraints are active (a walking robot), and slow if
    many are (a falling robot). An interior-point method takes about the same time for every problem. The
    limits are on iterations, not on time, so that a simulation in lockstep is reproducible.

    Args:
        daqp_iterations: limit after which PIQP is used.
        piqp_iterations: limit of PIQP.
        accept_unfinished: whether PIQP's last iterate is returned at its limit. It may violate a bound
            slightly, and by any amount if no solution exists.
    """

    def __init__(
        self, daqp_iterations: int = 100, piqp_iterations: int = 15, accept_unfinished: bool = True
    ) -> None:
        self._daqp_iterations = daqp_iterations
        self._piqp_iterations = piqp_iterations
        self._usable = [piqp.PIQP_SOLVED]
        if accept_unfinished:
            self._usable.append(piqp.PIQP_MAX_ITER_REACHED)
        self.fallbacks = 0

    def solve(self, problem: QuadraticProgram) -> np.ndarray | None:
        """Minimiser (variables,), or None if neither solver gives a usable result."""
        if len(problem.gradient) == 0:
            return problem.gradient
        solution, _, status, _ = daqp.solve(
            problem.hessian,
            problem.gradient,
            problem.rows,
            problem.upper,
            problem.lower,
            iter_limit=self._daqp_iterations,
        )
        if status > 0 and np.isfinite(solution).all():
            return np.asarray(solution)
        self.fallbacks += 1
        return self._interior_point(problem)

    def _interior_point(self, problem: QuadraticProgram) -> np.ndarray | None:
        variables, bounded = len(problem.gradient), len(problem.upper) - len(problem.rows)
        lower, upper = np.full(variables, -_SOFT_INFINITY), np.full(variables, _SOFT_INFINITY)
        lower[:bounded], upper[:bounded] = problem.lower[:bounded], problem.upper[:bounded]
        solver = piqp.DenseSolver()
        solver.settings.max_iter = self._piqp_iterations
        solver.settings.eps_abs = solver.settings.eps_rel = 1e-6
        solver.settings.check_duality_gap = False
        solver.setup(
            np.asfortranarray(problem.hessian),
            problem.gradient,
            G=np.asfortranarray(problem.rows),
            h_l=problem.lower[bounded:],
            h_u=problem.upper[bounded:],
            x_l=lower,
            x_u=upper,
        )
        status = solver.solve()
        solution = np.array(solver.result.x)
        return solution if status in self._usable and np.all(np.isfinite(solution)) else None
