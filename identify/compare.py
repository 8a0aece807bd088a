"""Compares a log's motion with a simulation of its commands, and suggests causes of the difference."""

from dataclasses import dataclass, replace

import numpy as np

from footfall.identify.fit import FitConfig, problem_of
from footfall.identify.leg import FixedLeg
from footfall.identify.parameters import QUANTITIES
from footfall.identify.problem import Problem
from footfall.identify.recording import Recording

MIN_EXPLAINED_SHARE = 0.3  # of a joint's squared error: a quantity that explains less is not named
RIDGE = 1e-6  # added to the normal equations: limits a parameter's step to a thousand scales


@dataclass(frozen=True)
class LegGap:
    """The difference between a leg's recorded motion and the nominal simulation."""

    leg: FixedLeg
    error_rad: np.ndarray  # (n,) rms error of positions over windows with their best starts
    noise_rad: np.ndarray  # (n,) noise of the position readings
    explains: tuple[dict[str, float], ...]  # by joint: share of its squared error explained by each quantity

    def verdict(self, joint: int) -> str:
        """The quantity that best explains a joint's error, in one line."""
        if self.error_rad[joint] < 2.0 * self.noise_rad[joint]:
            return "within the noise of its readings"
        name, share = max(self.explains[joint].items(), key=lambda each: each[1])
        if share < MIN_EXPLAINED_SHARE:
            return "no single parameter explains it"
        return f"{name} explains {share:.0%}"


def compare_leg(leg: FixedLeg, recording: Recording, config: FitConfig | None = None) -> LegGap:
    """Simulate a recording's commands on the nominal leg.

    A quantity's share comes from one Gauss-Newton step of that quantity alone, for the whole leg.

    Raises:
        UserError: the recording is too short, or the base moved in it.
    """
    problem = problem_of(leg, [recording], config or FitConfig())
    x = np.zeros(len(problem.parameters))
    problem.refine_starts(x)
    problem.refine_starts(x)
    errors, _ = problem.errors(x[:, None])
    positions = replace(problem, torque_sigma=np.full(leg.count, np.inf))
    positions.start = problem.start
    residual, slope = positions.slopes(x)
    by_joint = [_joint_residuals(positions, joint) for joint in range(leg.count)]
    return LegGap(
        leg,
        np.sqrt((errors**2).mean(axis=(0, 1, 2))),
        problem.position_sigma,
        tuple(_explained_shares(problem, residual[:, indices], slope[:, indices]) for indices in by_joint),
    )


def _joint_residuals(problem: Problem, joint: int) -> np.ndarray:
    """Indices of a joint's position residuals among all residuals of a window."""
    rows, n = problem.windows.position.shape[1:]
    return np.arange(rows) * n + joint


def _explained_shares(problem: Problem, residual: np.ndarray, slope: np.ndarray) -> dict[str, float]:
    """Share of the squared residual explained by each quantity."""
    flat, slopes_flat = residual.reshape(-1), slope.reshape(-1, slope.shape[2])
    total = float(flat @ flat)
    shares = {}
    for name in QUANTITIES:
        columns = [column for column, each in enumerate(problem.parameters) if each.quantity == name]
        own_slopes = slopes_flat[:, columns]
        step = np.linalg.solve(own_slopes.T @ own_slopes + RIDGE * np.eye(len(columns)), own_slopes.T @ flat)
        remaining = flat - own_slopes @ step
        shares[name] = 1.0 - float(remaining @ remaining) / total if total else 0.0
    return shares
