"""Figures of a scenario, computed from the outcomes of its episodes: plain data for JSON."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from footfall.evaluate.episodes import EpisodeOutcome
from footfall.evaluate.metrics import EpisodeMetrics
from footfall.evaluate.missions import mission_figures
from footfall.evaluate.own_metrics import SECTION
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.scenarios import Scenario
from footfall.evaluate.statistics import (
    bootstrap_mean_interval,
    fit_survival,
    weighted_mean,
    wilson_interval,
)

Summary = dict[str, Any]

# Figures that are roots of weighted means over episodes: the quantity and its weight.
_ROOT_MEANS = {
    "lin_vel_rmse": ("lin_vel_mse", "scored_s"),
    "yaw_rate_rmse": ("yaw_rate_mse", "scored_s"),
    "estimate_rmse": ("estimate_mse", "scored_s"),
    "target_rate_rad_s": ("target_rate_rad_s", "walked_s"),
    "torque_rate_nm_s": ("torque_rate_nm_s", "walked_s"),
}
# Quantities that are root mean squares of an episode: they are squared again before the mean.
_ALREADY_ROOTS = frozenset({"target_rate_rad_s", "torque_rate_nm_s"})
_MEANS = {
    "legs_touch_share": ("legs_touch_share", "walked_s"),
    "foot_slip_m_s": ("foot_slip_m_s", "stance_s"),
}
# Ratios of totals: energy over weight times distance, or over distance.
_ENERGY_PER_DISTANCE = {
    "cost_of_transport": ("electrical_j", True),
    "cost_of_transport_mechanical": ("mechanical_j", True),
    "positive_work_j_m": ("positive_j", False),
}
_MIN_DISTANCE_M = 0.1  # a robot that stands still has no cost of transport


def summarise(scenario: Scenario, outcomes: Sequence[TaskResult[EpisodeOutcome]], seed: int) -> Summary:
    """Figures of one scenario. A figure that was not measured is None.

    Args:
        scenario: definition of the scenario.
        outcomes: outcomes of its episodes; failed episodes are listed and not part of the figures.
        seed: seed of the bootstrap.
    """
    finished = [outcome.value for outcome in outcomes if outcome.value is not None]
    errors = [f"episode {i}: {outcome.error}" for i, outcome in enumerate(outcomes) if outcome.error]
    summary: Summary = {"episodes": len(finished), "failed_episodes": errors}
    if not finished:
        return summary
    summary |= _figures(finished, seed)
    if scenario.ground is not None:
        summary |= _successes(finished)
    summary |= _compute(finished)
    if finished[0].recovery_s is not None:
        summary |= _recoveries(finished)
    if scenario.mission is not None:
        summary |= mission_figures([outcome.mission for outcome in finished if outcome.mission])
    if finished[0].own:
        summary |= _own(finished, seed)
    if len(scenario.script) == 1 and not scenario.levels:
        summary["mean_forward_m_s"] = summary["mean_velocity"][0]
    if scenario.rows:
        summary["rows"] = _rows(scenario, finished, seed)
    if "push_m_s" in scenario.levels:
        summary |= _survival(finished, seed)
    summary["troubles"] = _reasons_for_ending(finished)
    summary["notes"] = sorted({note for outcome in finished for note in outcome.notes})
    return _plain(summary)


def _figures(finished: Sequence[EpisodeOutcome], seed: int) -> Summary:
    metrics = [outcome.metrics for outcome in finished]
    falls = sum(m.fell for m in metrics)
    figures: Summary = {
        "falls": falls,
        "fall_rate": falls / len(metrics),
        "fall_rate_interval": wilson_interval(falls, len(metrics)),
        "emergency_stops": sum(m.emergency_stop for m in metrics),
        "legs_touch_episodes": sum(m.legs_touch_share > 0.0 for m in metrics),
    }
    for name, (quantity, weight) in _ROOT_MEANS.items():
        values, weights = _column(metrics, quantity), _column(metrics, weight)
        values = values**2 if name in _ALREADY_ROOTS else values
        figures[name] = math.sqrt(weighted_mean(values, weights))
        figures[f"{name}_interval"] = [
            math.sqrt(edge) for edge in bootstrap_mean_interval(values, weights, seed)
        ]
    for name, (quantity, weight) in _MEANS.items():
        values, weights = _column(metrics, quantity), _column(metrics, weight)
        figures[name] = weighted_mean(values, weights)
        figures[f"{name}_interval"] = bootstrap_mean_interval(values, weights, seed)
    distance = _column(metrics, "distance_m")
    travelled = np.where(distance > _MIN_DISTANCE_M, distance, 0.0)
    for name, (energy, by_weight) in _ENERGY_PER_DISTANCE.items():
        weights = travelled * (_column(metrics, "weight_n") if by_weight else 1.0)
        ratios = np.divide(
            _column(metrics, energy), weights, out=np.full(len(metrics), np.nan), where=weights > 0
        )
        figures[name] = weighted_mean(ratios, weights)
        figures[f"{name}_interval"] = bootstrap_mean_interval(ratios, weights, seed)
    velocity = np.array([m.mean_velocity for m in metrics]).reshape(-1, 3)
    scored = _column(metrics, "scored_s")
    figures["mean_velocity"] = [weighted_mean(column, scored) for column in velocity.T]
    figures["positive_work_j"] = weighted_mean(_column(metrics, "positive_j"), np.ones(len(metrics)))
    figures["peak_torque_nm"] = _largest(metrics, "peak_torque_nm")
    figures["peak_torque_share"] = _largest(metrics, "peak_torque_share")
    return figures


def _own(finished: Sequence[EpisodeOutcome], seed: int) -> Summary:
    """Mean and 95 % interval of each metric of the user; every episode has equal weight."""
    values = {name: np.array([outcome.own[name] for outcome in finished]) for name in finished[0].own}
    equal_weights = np.ones(len(finished))
    return {
        SECTION: {name: weighted_mean(column, equal_weights) for name, column in values.items()},
        f"{SECTION}_interval": {
            name: bootstrap_mean_interval(column, equal_weights, seed) for name, column in values.items()
        },
    }


def compute_figures(compute_ms: np.ndarray, period_ms: float) -> Summary:
    """Time per policy step, ms, and the share of steps that took longer than the policy's period."""
    if not len(compute_ms):
        return {"compute_ms": {"p50": None, "p99": None}, "missed_deadlines": None}
    p50, p99 = np.percentile(compute_ms, [50, 99])
    return {
        "compute_ms": {"p50": float(p50), "p99": float(p99)},
        "missed_deadlines": float((compute_ms > period_ms).mean()),
    }


def _compute(finished: Sequence[EpisodeOutcome]) -> Summary:
    return compute_figures(
        np.concatenate([outcome.compute_ms for outcome in finished]), finished[0].period_ms
    )


def _successes(finished: Sequence[EpisodeOutcome]) -> Summary:
    """Number of episodes in which the robot stayed up and followed its command, with its interval."""
    successes = sum(outcome.metrics.succeeded for outcome in finished)
    return {
        "successes": successes,
        "success_rate": successes / len(finished),
        "success_rate_interval": wilson_interval(successes, len(finished)),
    }


def _recoveries(finished: Sequence[EpisodeOutcome]) -> Summary:
    """Falls from which the robot got up, and the mean time until it stood; None without one."""
    times_s = [time_s for outcome in finished for time_s in outcome.recovery_s or ()]
    return {"recoveries": len(times_s), "recovery_s": float(np.mean(times_s)) if times_s else None}


def _rows(scenario: Scenario, finished: Sequence[EpisodeOutcome], seed: int) -> list[Summary]:
    """Figures for each combination of levels, in rising order."""
    names = scenario.rows
    groups: dict[tuple[float, ...], list[EpisodeOutcome]] = {}
    for outcome in finished:
        groups.setdefault(tuple(outcome.levels[name] for name in names), []).append(outcome)
    rows = []
    for levels in sorted(groups):
        figures = _figures(groups[levels], seed)
        keys = ("falls", "fall_rate_interval", "lin_vel_rmse", "yaw_rate_rmse", "cost_of_transport")
        row = dict(zip(names, levels, strict=True)) | {"episodes": len(groups[levels])}
        on_ground = {} if scenario.ground is None else _successes(groups[levels])
        rows.append(row | {key: figures[key] for key in keys} | on_ground)
    return rows


def _survival(finished: Sequence[EpisodeOutcome], seed: int) -> Summary:
    pushes = [outcome.levels["push_m_s"] for outcome in finished]
    fit = fit_survival(pushes, [not outcome.metrics.fell for outcome in finished], seed)
    return {
        "dv50": fit.dv50 if fit.dv50 > 0 else None,
        "dv50_interval": fit.interval,
        "dv50_width": fit.width,
        "weakest_push": min(pushes),
        "strongest_push": max(pushes),
    }


def _reasons_for_ending(finished: Sequence[EpisodeOutcome]) -> dict[str, int]:
    """Number of episodes for each reason of a fall or a stop."""
    reasons = [outcome.trouble for outcome in finished if outcome.trouble]
    return {reason: reasons.count(reason) for reason in sorted(set(reasons))}


def _column(metrics: Sequence[EpisodeMetrics], name: str) -> np.ndarray:
    return np.array([getattr(m, name) for m in metrics], dtype=float)


def _largest(metrics: Sequence[EpisodeMetrics], name: str) -> float:
    values = _column(metrics, name)
    values = values[np.isfinite(values)]
    return float(values.max()) if len(values) else math.nan


def _plain(value: Any) -> Any:
    """The value with lists instead of tuples, and None instead of NaN and infinities."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value
