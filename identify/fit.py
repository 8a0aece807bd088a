"""Fits a leg's parameters to recordings of it, judges them on others, and says what the data cannot tell."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from mujoco import minimize

from footfall.common.errors import UserError
from footfall.identify.leg import FixedLeg
from footfall.identify.parameters import ORDER, Parameter, parameters_of
from footfall.identify.problem import LEAST_TORQUE_NM, Problem
from footfall.identify.recording import Recording
from footfall.identify.resampling import block_weights, refitted
from footfall.identify.windows import Windows, cut, joined

STEP = 1e-4  # of finite differences, in scales
MISFIT = 3.0  # residual over noise from which the model is wrong
UNTOLD = 0.3  # deviation, in scales, from which a direction of parameters is not told by the data
LOADING = 0.3  # share of a direction's largest part from which a parameter belongs to it
MOST_TURN_RAD_S = 0.05  # of a base that counts as fixed
RESAMPLES = 60
DEVIATIONS = 2.57  # in the half-width of an interval of 95 %: Student's t, as if six windows told
LONGEST_STEP = 3.0  # of a round, in scales
COARSE = 3  # every such window counts at first
SETTLED = 3e-3  # of a round's step, in scales: the fit has converged
UNWEIGHTED = 2  # rounds before outliers count less


@dataclass(frozen=True)
class FitConfig:
    """How recordings are cut and how long the fit looks."""

    window_s: float = 1.0
    rate_hz: float = 500.0  # of the readings that count
    rounds: int = 8  # of Gauss-Newton steps at most, starts and weights refined between them
    hold_out_every: int = 4  # each such window judges, where no recording is held out
    seed: int = 0


@dataclass(frozen=True)
class Estimate:
    """One parameter: its value and an interval of 95 % by bootstrap over windows."""

    parameter: Parameter
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class LegFit:
    """What the data say of a leg."""

    leg: FixedLeg
    estimates: tuple[Estimate, ...]
    frozen: tuple[Parameter, ...]  # kept nominal: the data do not tell them apart from others
    noise_rad: np.ndarray  # (n,) of the position readings
    residual_rad: np.ndarray  # (n,) rms of fitted positions over the windows of the fit
    held_out_rad: np.ndarray  # (n,) rms over the held-out windows
    nominal_rad: np.ndarray  # (n,) the same of the nominal leg

    @property
    def misfit(self) -> np.ndarray:
        """Residual over noise, (n,): beyond `MISFIT` the model lacks an effect."""
        return self.residual_rad / self.noise_rad

    def value(self, quantity: str, owner: str) -> float | None:
        """An estimate; None if it was frozen."""
        wanted = Parameter(quantity, owner)
        return next((each.value for each in self.estimates if each.parameter == wanted), None)


def fit_leg(
    leg: FixedLeg,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording] = (),
    config: FitConfig | None = None,
) -> LegFit:
    """Fit one leg.

    Args:
        leg: nominal.
        recordings: of the robot on a stand.
        held_out: others that judge; without any, each `hold_out_every`-th window does.
        config: of the fit.

    Raises:
        UserError: a recording is too short, or the base moved in it.
    """
    config = config or FitConfig()
    for each in (*recordings, *held_out):
        _check_still(each)
    windows = _windows(leg, recordings, config)
    if held_out:
        judging = _windows(leg, held_out, config)
    else:
        chosen = np.arange(windows.width) % config.hold_out_every == config.hold_out_every - 1
        if not chosen.any():
            raise UserError(f"{windows.width} windows are too few to hold one out: record for longer")
        windows, judging = windows.take(~chosen), windows.take(chosen)
    problem = _problem(leg, recordings, windows)
    noise, torque = problem.position_sigma, problem.torque_sigma
    nominal_x = np.zeros(len(problem.parameters))
    problem.refine_starts(nominal_x)
    problem, frozen, _ = _without_untold(problem, slopes(problem, nominal_x), fitted=False)
    x = _solve(problem, config, np.zeros(len(problem.parameters)))
    slope = slopes(problem, x)
    problem, late, kept = _without_untold(problem, slope, fitted=True)
    if late:
        x = _solve(problem, config, x[kept])
        slope = slopes(problem, x)
    fixed = problem.fixed
    position, _ = problem.errors(x[:, None])
    judge = Problem(leg, judging, problem.parameters, fixed, noise, torque)
    return LegFit(
        leg,
        _estimates(problem, x, slope, config.seed),
        (*frozen, *late),
        noise,
        _rms(position),
        _judged(judge, x),
        _judged(replace(judge, fixed={}), np.zeros(len(x))),
    )


def problem_of(leg: FixedLeg, recordings: Sequence[Recording], config: FitConfig) -> Problem:
    """All parameters of a leg over all windows of recordings.

    Raises:
        UserError: a recording is too short, or the base moved in it.
    """
    for each in recordings:
        _check_still(each)
    return _problem(leg, recordings, _windows(leg, recordings, config))


def _problem(leg: FixedLeg, recordings: Sequence[Recording], windows: Windows) -> Problem:
    noise = np.mean([each.position_noise_rad[leg.joints] for each in recordings], axis=0)
    return Problem(leg, windows, parameters_of(leg), {}, noise, _torque_noise(leg, recordings))


def _check_still(recording: Recording) -> None:
    if recording.turn_rad_s > MOST_TURN_RAD_S:
        raise UserError(
            f"{recording.source}: the base turns at {recording.turn_rad_s:.2f} rad/s (rms),"
            f" {MOST_TURN_RAD_S:g} at most: bolt it to a stand"
        )


def _windows(leg: FixedLeg, recordings: Sequence[Recording], config: FitConfig) -> Windows:
    step_s = float(leg.model.opt.timestep)
    return joined([cut(each, leg.joints, config.window_s, step_s, config.rate_hz) for each in recordings])


def _torque_noise(leg: FixedLeg, recordings: Sequence[Recording]) -> np.ndarray:
    """Deviation of torque readings, (n,); infinite where there are none."""
    third = np.concatenate([np.diff(each.torque[:, leg.joints], 3, axis=0) for each in recordings])
    noise = np.sqrt((third**2).mean(axis=0) / 20.0)
    told = np.isfinite(noise) & (noise > 0.0)
    result: np.ndarray = np.where(told, np.maximum(noise, LEAST_TORQUE_NM), np.inf)
    return result


def _solve(problem: Problem, config: FitConfig, x: np.ndarray) -> np.ndarray:
    """Gauss-Newton from x, starts and weights refined before each step; on some of the windows at first."""
    if problem.windows.width >= COARSE * COARSE:
        some = np.arange(problem.windows.width) % COARSE == 0
        coarse = replace(problem, windows=problem.windows.take(some))
        x = _rounds(coarse, config.rounds // 2, x)
    return _rounds(problem, config.rounds, x)


def _rounds(problem: Problem, rounds: int, x: np.ndarray) -> np.ndarray:
    """At most `rounds` steps; fewer if they settle."""
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


def slopes(problem: Problem, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals by window, (W, m), and their slopes, (W, m, p), at x."""
    eps = 1e-3
    inward = np.where(x + eps > problem.high, -eps, eps)
    found = problem.by_window(np.concatenate([x[:, None], x[:, None] + np.diag(inward)], axis=1))
    slope = (found[1:] - found[0]) / inward[:, None, None]
    return found[0], np.moveaxis(slope, 0, 2)


def _without_untold(
    problem: Problem, slope: tuple[np.ndarray, np.ndarray], fitted: bool
) -> tuple[Problem, tuple[Parameter, ...], list[int]]:
    """The problem without parameters that its data cannot tell from others; those; and the rows of the rest.

    A direction whose deviation is large is untold. Of the parameters in it, the first one of `ORDER` goes.
    Residuals count as their noise before a fit, and as they are after it. `slope` as `slopes` gives it.
    """
    residual, by_parameter = slope
    noise = float(np.sqrt((residual**2).mean()).clip(1.0, MISFIT if fitted else 1.0))
    flat = by_parameter.reshape(-1, by_parameter.shape[2]) / noise
    gram = flat.T @ flat
    kept = list(range(len(gram)))
    frozen: list[Parameter] = []
    while len(kept) > 1:
        sizes, directions = np.linalg.eigh(gram[np.ix_(kept, kept)])
        if sizes[0] * UNTOLD**2 >= 1.0:
            break
        part = np.abs(directions[:, 0])
        inside = [kept[row] for row in np.flatnonzero(part > LOADING * part.max())]
        goes = min(inside, key=lambda row: ORDER.index(problem.parameters[row].quantity))
        frozen.append(problem.parameters[goes])
        kept.remove(goes)
    if not frozen:
        return problem, (), kept
    free = tuple(problem.parameters[row] for row in kept)
    return replace(problem, parameters=free), tuple(frozen), kept


def _estimates(
    problem: Problem, x: np.ndarray, slope: tuple[np.ndarray, np.ndarray], seed: int
) -> tuple[Estimate, ...]:
    """Values with intervals, by bootstrap over windows with refits; `slope` as `slopes` gives it."""
    weights = block_weights(problem.windows.source, RESAMPLES, np.random.default_rng(seed))
    refits = refitted(x, *slope, weights, problem.by_window)
    scale = np.array([each.kind.scale for each in problem.parameters])
    half = DEVIATIONS * refits.std(axis=0) * scale
    found = problem.numbers(x[:, None])[:, 0]
    return tuple(
        Estimate(parameter, float(value), float(value - each), float(value + each))
        for parameter, value, each in zip(problem.parameters, found, half, strict=True)
    )


def _judged(problem: Problem, x: np.ndarray) -> np.ndarray:
    """Rms of predicted positions with the best starts, rad, (n,)."""
    problem.refine_starts(x)
    problem.refine_starts(x)
    return _rms(problem.errors(x[:, None])[0])


def _rms(errors: np.ndarray) -> np.ndarray:
    result: np.ndarray = np.sqrt((errors**2).mean(axis=(0, 1, 2)))
    return result
