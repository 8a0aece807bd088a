"""Fits a leg's parameters to recordings, validates them on others, and lists unidentifiable parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.identify.explain import Explanation, explained
from footfall.identify.identifiable import delay_profile, freeze_unidentifiable
from footfall.identify.leg import FixedLeg
from footfall.identify.null_space import Direction, Profile
from footfall.identify.parameters import Parameter, parameters_of
from footfall.identify.problem import MIN_TORQUE_SIGMA_NM, Problem
from footfall.identify.recording import Recording, reading_noise
from footfall.identify.resampling import block_weights, refitted
from footfall.identify.solver import solve
from footfall.identify.windows import Windows, cut, joined

MISFIT_RATIO = 2.0  # residual over noise of a wrong model; correct models had at most 1.04 in 20 fits
TORQUE_SHARE = 0.1  # largest error of correct torque readings, as a share of their rms; 0.01 in a simulation
MAX_NOISE = 3.0  # maximum noise of the readings assumed when unidentifiable directions are searched
MAX_TURN_RAD_S = 0.05  # maximum angular velocity of a base that counts as fixed
RESAMPLES = 60
INTERVAL_SIGMAS = 3.18  # half-width of a 95 % interval in deviations: Student's t for four windows


@dataclass(frozen=True)
class FitConfig:
    """Settings of the fit."""

    window_s: float = 1.0
    rate_hz: float = 500.0  # maximum rate of the readings that are used
    rounds: int = 8  # maximum number of Gauss-Newton steps; starts and weights are refined between them
    hold_out_every: int = 4  # without a held-out recording, every such window is held out
    effects: tuple[str, ...] = ()  # additional parameters to fit, from `EFFECTS`
    profile: bool = False  # whether to compute a profile over the delay
    explain: bool = True  # whether to search for an effect that explains a misfit
    seed: int = 0


@dataclass(frozen=True)
class Estimate:
    """One parameter: value and 95 % interval, from a bootstrap over windows."""

    parameter: Parameter
    value: float
    low: float
    high: float


class Track(NamedTuple):
    """Motion in W windows of R readings, each with its best start, (W, R, n)."""

    time_s: np.ndarray  # since the start of the window
    measured_rad: np.ndarray
    fitted_rad: np.ndarray
    nominal_rad: np.ndarray


@dataclass(frozen=True)
class LegFit:
    """Result of a leg's fit."""

    leg: FixedLeg
    estimates: tuple[Estimate, ...]
    frozen: dict[Parameter, Direction]  # unidentifiable parameters, which keep their nominal values
    noise_rad: np.ndarray  # (n,) noise of the position readings
    residual_rad: np.ndarray  # (n,) rms error of fitted positions over the windows used for fitting
    held_out: Track
    torque_error: np.ndarray  # (n,) rms error of fitted torques, as a share of the readings' rms; NaN without
    explanation: Explanation | None = None  # cause of a misfit
    profile: Profile | None = None  # over the delay, if requested

    @property
    def held_out_rad(self) -> np.ndarray:
        """Rms error of the fitted leg's positions over the held-out windows, (n,)."""
        return _rms(self.held_out.fitted_rad - self.held_out.measured_rad)

    @property
    def nominal_rad(self) -> np.ndarray:
        """Rms error of the nominal leg's positions over the held-out windows, (n,)."""
        return _rms(self.held_out.nominal_rad - self.held_out.measured_rad)

    @property
    def misfit(self) -> np.ndarray:
        """Residual relative to noise, (n,): above `MISFIT_RATIO` the model lacks an effect."""
        return self.residual_rad / self.noise_rad

    def value(self, quantity: str, owner: str) -> float | None:
        """The estimate of a parameter; None if it was frozen."""
        parameter = Parameter(quantity, owner)
        return next((each.value for each in self.estimates if each.parameter == parameter), None)


def fit_leg(
    leg: FixedLeg,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording] = (),
    config: FitConfig | None = None,
) -> LegFit:
    """Fit one leg.

    Args:
        leg: nominal leg.
        recordings: recordings of the robot on a stand.
        held_out: recordings for validation; if empty, each `hold_out_every`-th window is held out.
        config: settings of the fit.

    Raises:
        UserError: a recording is too short, or the base moved in it.
    """
    config = config or FitConfig()
    for each in (*recordings, *held_out):
        _check_still(each)
    windows, held_out_windows = _split(leg, recordings, held_out, config)
    problem = _problem(leg, recordings, windows, config.effects)
    left_out = np.zeros(leg.count, bool)
    solution = _solved(problem, config.rounds, left_out)
    for _ in range(leg.count):
        limit = TORQUE_SHARE if left_out.any() else np.nanmax(solution.torque_error, initial=TORQUE_SHARE)
        wrong = solution.torque_error >= limit
        if not (wrong & ~left_out).any():
            break
        # Wrong readings shift the parameters, and thereby the torques of other joints.
        left_out = wrong
        solution = _solved(problem, config.rounds, left_out)
    x, reduced = solution.x, solution.problem
    noise, residual_rad = reduced.position_sigma, _rms(reduced.errors(x[:, None])[0][0])
    torque_sigma = np.where(left_out, np.inf, problem.torque_sigma)
    return LegFit(
        leg,
        _estimates(reduced, x, solution.residual, solution.slope, config.seed),
        solution.frozen,
        noise,
        residual_rad,
        _track(Problem(leg, held_out_windows, reduced.parameters, {}, noise, torque_sigma), x),
        solution.torque_error,
        explained(reduced, x) if config.explain and (residual_rad > MISFIT_RATIO * noise).any() else None,
        delay_profile(reduced, x) if config.profile else None,
    )


class _Solution(NamedTuple):
    problem: Problem  # with the parameters that the recordings determine
    x: np.ndarray  # (p,)
    residual: np.ndarray  # and `slope`: as `Problem.slopes` returns them
    slope: np.ndarray
    frozen: dict[Parameter, Direction]
    torque_error: np.ndarray  # (n,), also of joints whose torque readings were left out


def _solved(problem: Problem, rounds: int, left_out: np.ndarray) -> _Solution:
    """Solution of a leg's problem without the torque readings of joints in `left_out`; keeps `problem`."""
    noise = problem.torque_sigma
    problem = replace(problem, torque_sigma=np.where(left_out, np.inf, noise))
    nominal_x = np.zeros(len(problem.parameters))
    problem.refine_starts(nominal_x)
    problem, _, frozen = freeze_unidentifiable(problem, problem.slopes(nominal_x)[1], 1.0)
    x = solve(problem, rounds, np.zeros(len(problem.parameters)))
    residual, slope = problem.slopes(x)
    residual_sigma = float(np.sqrt((residual**2).mean()).clip(1.0, MAX_NOISE))
    problem, kept, frozen_later = freeze_unidentifiable(problem, slope, residual_sigma)
    if frozen_later:
        x = solve(problem, rounds, x[kept])
        residual, slope = problem.slopes(x)
    return _Solution(problem, x, residual, slope, frozen | frozen_later, torque_error(problem, x, noise))


def _split(
    leg: FixedLeg, recordings: Sequence[Recording], held_out: Sequence[Recording], config: FitConfig
) -> tuple[Windows, Windows]:
    """Windows for fitting, and for validation."""
    windows = _windows(leg, recordings, config)
    if held_out:
        return windows, _windows(leg, held_out, config)
    validation = np.arange(windows.width) % config.hold_out_every == config.hold_out_every - 1
    if not validation.any():
        raise UserError(f"{windows.width} windows are too few to hold one out: record longer")
    return windows.take(~validation), windows.take(validation)


def held_out_error(
    leg: FixedLeg,
    recordings: Sequence[Recording],
    held_out: Sequence[Recording],
    values: dict[Parameter, float],
    config: FitConfig,
) -> np.ndarray:
    """Rms position error of a leg over the held-out windows, each from its best start, rad, (n,).

    Torque readings are not used, so that motors with different torque reports can be compared by their
    motion.

    Args:
        leg: leg with its motors, and their net if they have one.
        recordings: as in `fit_leg`.
        held_out: as in `fit_leg`.
        values: values of parameters that are not nominal.
        config: settings of the fit.
    """
    windows, held_out_windows = _split(leg, recordings, held_out, config)
    noise = _problem(leg, recordings, windows).position_sigma
    problem = Problem(leg, held_out_windows, (), values, noise, np.full(leg.count, np.inf))
    problem.refine_starts(np.zeros(0))
    problem.refine_starts(np.zeros(0))
    return _rms(problem.errors(np.zeros((0, 1)))[0][0])


def problem_of(leg: FixedLeg, recordings: Sequence[Recording], config: FitConfig) -> Problem:
    """All parameters of a leg over all windows of recordings.

    Raises:
        UserError: a recording is too short, or the base moved in it.
    """
    for each in recordings:
        _check_still(each)
    return _problem(leg, recordings, _windows(leg, recordings, config))


def _problem(
    leg: FixedLeg, recordings: Sequence[Recording], windows: Windows, effects: Sequence[str] = ()
) -> Problem:
    noise = np.mean([each.position_noise_rad[leg.joints] for each in recordings], axis=0)
    return Problem(leg, windows, parameters_of(leg, effects), {}, noise, _torque_noise(leg, recordings))


def _check_still(recording: Recording) -> None:
    if recording.turn_rad_s > MAX_TURN_RAD_S:
        raise UserError(
            f"{recording.source}: the base turns at {recording.turn_rad_s:.2f} rad/s (rms),"
            f" {MAX_TURN_RAD_S:g} at most: bolt it to a stand"
        )


def _windows(leg: FixedLeg, recordings: Sequence[Recording], config: FitConfig) -> Windows:
    settings = config.window_s, float(leg.model.opt.timestep), config.rate_hz
    return joined([cut(each, leg.joints, *settings) for each in recordings])


def torque_error(problem: Problem, x: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Rms error of the torques beyond their noise, as a share of the rms reading, (n,); NaN without readings.

    Args:
        problem: problem of the fit.
        x: solution, (p,).
        noise: standard deviation of the readings, N m, (n,); a fit overwrites `torque_sigma`.
    """
    error, reading = problem.errors(x[:, None])[1][0], problem.windows.torque
    beyond = np.sqrt(np.maximum(_rms(error) ** 2 - noise**2, 0.0))
    return np.where(np.isfinite(noise), beyond / np.maximum(_rms(reading), MIN_TORQUE_SIGMA_NM), np.nan)


def _torque_noise(leg: FixedLeg, recordings: Sequence[Recording]) -> np.ndarray:
    """Standard deviation of torque readings, (n,); infinite without readings."""
    noise = np.mean([reading_noise(each.torque[:, leg.joints]) for each in recordings], axis=0)
    reported = np.isfinite(noise) & (noise > 0.0)
    result: np.ndarray = np.where(reported, np.maximum(noise, MIN_TORQUE_SIGMA_NM), np.inf)
    return result


def _estimates(
    problem: Problem, x: np.ndarray, residual: np.ndarray, slope: np.ndarray, seed: int
) -> tuple[Estimate, ...]:
    """Values with intervals, from a bootstrap over windows.

    Args:
        problem: problem of the fit.
        x: solution, (p,).
        residual: residuals, (W, m), as `Problem.slopes` returns them.
        slope: their derivatives, (W, m, p).
        seed: seed of the bootstrap.
    """
    weights = block_weights(problem.windows.source, RESAMPLES, np.random.default_rng(seed))
    refits = refitted(x, residual, slope, weights, problem.by_window, (problem.low, problem.high))
    scale = np.array([each.declaration.scale for each in problem.parameters])
    half_widths = INTERVAL_SIGMAS * refits.std(axis=0) * scale
    values = problem.numbers(x[:, None])[:, 0]
    return tuple(
        Estimate(parameter, float(value), float(value - each), float(value + each))
        for parameter, value, each in zip(problem.parameters, values, half_widths, strict=True)
    )


def _track(problem: Problem, x: np.ndarray) -> Track:
    """Predicted motion of the fitted and the nominal leg."""
    windows = problem.windows
    paths = []
    for candidate in (x, np.zeros(len(x))):
        problem.refine_starts(candidate)
        problem.refine_starts(candidate)
        paths.append(problem.errors(candidate[:, None])[0][0] + windows.position)
    return Track(windows.time_s, windows.position, *paths)


def _rms(errors: np.ndarray) -> np.ndarray:
    """Rms over windows and readings, (n,), of (W, R, n)."""
    result: np.ndarray = np.sqrt((errors**2).mean(axis=(0, 1)))
    return result
