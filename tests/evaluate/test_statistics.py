"""Intervals and the logistic fit."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy  # its parts are loaded where they are used
from hypothesis import given
from hypothesis import strategies as st
from traces import walk

from footfall.evaluate.metrics import score
from footfall.evaluate.statistics import bootstrap_mean_interval, fit_survival, weighted_mean, wilson_interval
from footfall.robots.description import Robot


@pytest.mark.parametrize(("successes", "trials"), [(0, 1), (1, 7), (12, 24), (96, 96), (499, 500)])
def test_the_wilson_interval_equals_scipys(successes: int, trials: int) -> None:
    by_scipy = scipy.stats.binomtest(successes, trials).proportion_ci(method="wilson")
    assert wilson_interval(successes, trials) == pytest.approx((by_scipy.low, by_scipy.high))


class TestBootstrap:
    def test_the_bootstrap_interval_equals_scipys_for_weighted_episodes(self) -> None:
        rng = np.random.default_rng(4)
        values, weights = rng.normal(size=60), rng.uniform(1.0, 20.0, 60)
        low, high = scipy.stats.bootstrap(
            (values, weights), lambda value, weight, axis: np.average(value, axis, weight),
            paired=True, method="percentile", rng=rng,
        ).confidence_interval  # fmt: skip
        assert bootstrap_mean_interval(values, weights) == pytest.approx((low, high), abs=0.1 * (high - low))

    def test_long_episodes_weigh_more_and_unmeasured_episodes_nothing(self) -> None:
        assert weighted_mean([1.0, 3.0, np.nan], [3.0, 1.0, 5.0]) == 1.5
        assert math.isnan(weighted_mean([np.nan], [1.0]))
        assert math.isnan(weighted_mean([2.0, 3.0], [0.0, 0.0]))
        assert weighted_mean([1.0, 9.0], [2.0, np.inf]) == 1.0

    def test_an_episode_without_weight_does_not_count(self) -> None:
        values, weights = np.random.default_rng(6).normal(size=12), np.full(12, 3.0)
        alone = bootstrap_mean_interval(values, weights)
        assert bootstrap_mean_interval(values, weights) == alone
        assert bootstrap_mean_interval([*values, 99.0, np.nan], [*weights, 0.0, 5.0]) == alone
        assert bootstrap_mean_interval(values, weights, seed=1) != alone
        assert all(math.isnan(edge) for edge in bootstrap_mean_interval([1.0], [0.0]))


class TestSurvival:
    def test_the_fit_maximises_the_penalised_likelihood_like_scipy(self) -> None:
        pushes = np.array([0.5, 0.5, 1.0, 1.0, 1.5, 1.5, 1.5, 2.5, 2.5, 2.5])
        stood = np.array([1, 1, 1, 0, 1, 0, 1, 0, 0, 1])
        scaled = (pushes - 0.5) / 2.0

        def cost(coefficients: np.ndarray) -> float:
            offset, slope = coefficients
            score = offset + slope * scaled
            return float(np.sum(np.logaddexp(0, score) - stood * score) + 0.025 * slope**2 + 5e-7 * offset**2)

        offset, slope = scipy.optimize.minimize(cost, [0.0, 0.0], tol=1e-10).x
        fit = fit_survival(pushes, stood)
        assert fit.dv50 == pytest.approx(0.5 - 2.0 * offset / slope, rel=1e-3)
        assert fit.width == pytest.approx(-2.0 / slope, rel=1e-3)
        many = [fit_survival(np.tile(pushes, 8), np.tile(stood, 8), seed).interval for seed in (0, 0, 1)]
        assert many[0] == many[1] != many[2]
        assert many[0][0] < fit.dv50 < many[0][1]
        far = fit.chance(np.array([-1e9, 0.0, fit.dv50 + fit.width, 1e9]))
        assert far[[0, 3]] == pytest.approx([1.0, 0.0])
        assert far[2] == pytest.approx(1 / (1 + math.e))

    def test_a_median_outside_the_pushes_is_not_extrapolated(self) -> None:
        unmoved = fit_survival([0.5, 1.0, 1.5], [True] * 3)
        assert (unmoved.dv50, unmoved.interval) == (math.inf, (math.inf, math.inf))
        assert fit_survival([0.5, 1.0, 1.5, 2.0, 2.0, 2.0], [True] * 5 + [False]).dv50 == math.inf
        assert fit_survival([0.5, 1.0, 1.5], [False] * 3).dv50 == 0.0

    @given(st.lists(st.tuples(st.sampled_from([0.5, 1.0, 1.5, 2.0]), st.booleans()), min_size=1, max_size=20))
    def test_the_fit_is_never_nan(self, outcomes: list[tuple[float, bool]]) -> None:
        fit = fit_survival(*zip(*outcomes, strict=True))
        assert not math.isnan(fit.dv50)
        assert fit.interval[0] <= fit.interval[1]


def test_an_emergency_stop_counts_as_a_fall(go1: Robot) -> None:
    metrics = score(replace(walk(), final_state="ESTOP"), go1, 125.0)
    assert (metrics.fell, metrics.emergency_stop) == (True, True)


@pytest.mark.filterwarnings("error")
def test_a_fall_at_the_start_scores_nothing_else(go1: Robot) -> None:
    for seconds in (0.0, 0.01, 0.5):
        metrics = score(replace(walk(seconds), fell=True), go1, 125.0)
        assert (metrics.fell, metrics.scored_s) == (True, 0.0)
        assert np.isnan([metrics.lin_vel_mse, metrics.estimate_mse]).all()


def test_sway_within_a_stride_does_not_count_as_distance(go1: Robot) -> None:
    straight = walk(5.0)
    swaying = straight.base_position.copy()
    swaying[:, 1] += 0.02 * np.sin(2 * np.pi * 4.0 * straight.time_s)
    distance_m = score(replace(straight, base_position=swaying), go1, 125.0).distance_m
    assert distance_m == pytest.approx(5.0, rel=1e-2)


def test_each_score_is_computed_from_its_own_signal(go1: Robot) -> None:
    """The scores of a trace with different numbers in all fields equal plain sums."""
    rng = np.random.default_rng(3)
    count, rate_hz = 700, 50.0
    draws: dict[str, Any] = {
        "command": np.repeat(rng.normal(size=(2, 3)), [300, 400], axis=0),
        "base_velocity": rng.normal(size=(count, 3)),
        "base_angular_velocity": rng.normal(size=(count, 3)),
        "motor_torque": rng.normal(size=(count, 12)) * np.arange(1, 13),
        "joint_target": rng.normal(size=(count, 12)), "foot_velocity": rng.normal(size=(count, 4, 3)),
        "foot_contact": rng.random((count, 4)) < [0.2, 0.4, 0.6, 0.8],
        "estimated_velocity": rng.normal(size=(count, 3)), "electrical_power": rng.random(count),
        "mechanical_power": rng.random(count), "positive_power": rng.random(count),
        "base_position": np.outer(np.arange(count), [0.02, -0.015, 0.3]),
    }  # fmt: skip
    trace = replace(walk(7.0), time_s=np.arange(count) / rate_hz, record_rate_hz=rate_hz, **draws)
    found = score(trace, go1, 77.0)
    settled = np.r_[50:300, 350:700]
    assert (found.fell, found.emergency_stop, found.weight_n) == (False, False, 77.0)
    assert (found.scored_s, found.walked_s) == pytest.approx((600 / rate_hz, 14.0))
    fields = ("command", "base_velocity", "base_angular_velocity")
    command, linear, angular = (draws[name][settled] for name in fields)
    assert found.lin_vel_mse == pytest.approx(np.mean(np.sum((command - linear)[:, :2] ** 2, axis=1)))
    assert found.yaw_rate_mse == pytest.approx(np.mean((command[:, 2] - angular[:, 2]) ** 2))
    assert found.mean_velocity == pytest.approx([*linear[:, :2].mean(axis=0), angular[:, 2].mean()])
    off = draws["estimated_velocity"][settled, :2] - linear[:, :2]
    assert found.estimate_mse == pytest.approx(np.mean(np.sum(off**2, axis=1)))
    energies = (found.electrical_j, found.mechanical_j, found.positive_j)
    powers = ("electrical_power", "mechanical_power", "positive_power")
    assert energies == pytest.approx([draws[name].sum() / rate_hz for name in powers])
    torque = np.abs(draws["motor_torque"])
    assert found.peak_torque_nm == pytest.approx(torque.max())
    assert found.peak_torque_share == pytest.approx((torque.max(axis=0) / go1.motor.peak_torque).max())
    assert found.stance_s == pytest.approx(draws["foot_contact"].sum() / rate_hz)
    speeds = np.hypot(draws["foot_velocity"][..., 0], draws["foot_velocity"][..., 1])
    assert found.foot_slip_m_s == pytest.approx(speeds[draws["foot_contact"]].mean())
    for name, rate in (("joint_target", found.target_rate_rad_s), ("motor_torque", found.torque_rate_nm_s)):
        assert rate == pytest.approx(np.sqrt(np.mean((np.diff(draws[name], axis=0) * rate_hz) ** 2)))
    assert found.distance_m == pytest.approx(699 * 0.025, rel=0.05)
