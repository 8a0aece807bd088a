"""Intervals and the logistic fit."""

import math

import numpy as np
import pytest
import scipy  # its parts are loaded where they are used
from hypothesis import given
from hypothesis import strategies as st

from footfall.evaluate.statistics import bootstrap_mean_interval, fit_survival, weighted_mean, wilson_interval


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
