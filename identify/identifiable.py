"""Unidentifiable parameters of a leg, which keep their nominal values, and a profile over the delay."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from footfall.identify.null_space import Direction, Profile, null_directions, profile
from footfall.identify.parameters import FREEZING_ORDER, Parameter
from footfall.identify.problem import Problem
from footfall.identify.solver import coarsened, gauss_newton

MAX_SIGMA = 0.3  # standard deviation, in scales, above which a direction of parameters is unidentifiable
DELAY, PROFILE_ROUNDS = "delay_s", 4
SHIFTS_S = np.linspace(-0.004, 0.004, 9)  # changes of all delays of a leg, for a profile


class Reduced(NamedTuple):
    """A problem without its unidentifiable parameters."""

    problem: Problem
    kept: list[int]  # indices of the parameters that stay free
    frozen: dict[Parameter, Direction]  # unidentifiable parameters, each with its direction


def freeze_unidentifiable(problem: Problem, slope: np.ndarray, noise: float) -> Reduced:
    """The problem without its unidentifiable parameters.

    A direction with a large standard deviation is unidentifiable. Of its parameters, the first one in
    `FREEZING_ORDER` is frozen, until no such direction remains.

    Args:
        problem: problem with all parameters.
        slope: derivatives of the residuals by window, (W, m, p).
        noise: standard deviation of the residuals.
    """
    flat = slope.reshape(-1, slope.shape[2])
    # R of the QR decomposition, (p, p), has the singular values and right singular vectors of `flat`.
    factor: np.ndarray = np.asarray(np.linalg.qr(flat, mode="r"))
    rows = {each.label: row for row, each in enumerate(problem.parameters)}
    kept = list(range(len(rows)))
    frozen: dict[Parameter, Direction] = {}
    while len(kept) > 1:
        names = [problem.parameters[row].label for row in kept]
        worst = null_directions(factor[:, kept], names, noise, MAX_SIGMA)
        if not worst:
            break
        members = [rows[name] for name in worst[0].parts]
        first = min(members, key=lambda row: FREEZING_ORDER.index(problem.parameters[row].quantity))
        frozen[problem.parameters[first]] = worst[0]
        kept.remove(first)
    if frozen:
        problem = replace(problem, parameters=tuple(problem.parameters[row] for row in kept))
    return Reduced(problem, kept, frozen)


def delay_profile(problem: Problem, x: np.ndarray) -> Profile:
    """Fits with all delays of a leg shifted by some milliseconds, to see how much the motion depends on them.

    Args:
        problem: problem of the fit.
        x: solution of the fit, (p,).

    Returns:
        Shifts in seconds, rms of the residuals in units of their noise, and the other parameters in scales.
    """
    coarse = coarsened(problem)
    values = problem.numbers(x[:, None])[:, 0]
    delays = {
        each: value for each, value in zip(problem.parameters, values, strict=True) if each.quantity == DELAY
    }
    others = [row for row, each in enumerate(problem.parameters) if each.quantity != DELAY]
    free = tuple(problem.parameters[row] for row in others)

    def fit_at(shift_s: float) -> tuple[float, np.ndarray]:
        fixed = problem.fixed | {each: max(0.0, value + shift_s) for each, value in delays.items()}
        shifted = replace(coarse, parameters=free, fixed=fixed)
        best = gauss_newton(shifted, PROFILE_ROUNDS, x[others])
        position, _ = shifted.errors(best[:, None])
        return float(np.sqrt(((position / shifted.position_sigma) ** 2).mean())), best

    return profile(fit_at, SHIFTS_S.tolist())
