"""Intervals and the logistic fit."""

import math

import numpy as np
import pytest
import scipy.optimize
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from footfall.evaluate.statistics import bootstrap_mean_interval, fit_survival, weighted_mean, wilson_interval


class TestWilsonInterval:
    @given(st.integers(1, 500).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
    def test_lies_within_0_and_1_and_around_the_rate(self, counts: tuple[int, int]) -> None:
        successes, trials = counts
        low, high = wilson_interval(successes, trials)
        assert 0.0 <= low <= successes / trials <= high <= 1.0
        assert low < high

    @given(st.integers(0, 50), st.integers(0, 50))
    def test_mirrors_when_successes_and_failures_swap(self, successes: int, failures: int) -> None:
        low, high = wilson_interval(successes, successes + failures)
        mirrored = wilson_interval(failures, successes + failures)
        assert mirrored == pytest.approx((1 - high, 1 - low))

    def test_textbook_value(self) -> None:
        assert wilson_interval(10, 100) == pytest.approx((0.05522914, 0.17436566))

    @pytest.mark.parametrize(("successes", "trials"), [(0, 1), (1, 7), (12, 24), (96, 96), (499, 500)])
    def test_is_as_scipy_has_it(self, successes: int, trials: int) -> None:
        theirs = scipy.stats.binomtest(successes, trials).proportion_ci(method="wilson")
        assert wilson_interval(successes, trials) == pytest.approx((theirs.low, theirs.high))

    def test_no_falls_in_100_still_leave_room_for_some(self) -> None:
        assert wilson_interval(0, 100) == pytest.approx((0.0, 0.0369935), abs=1e-6)

    def test_covers_the_true_rate_about_95_times_in_100(self) -> None:
        draws = np.random.default_rng(1).binomial(40, 0.2, size=2000)
        intervals = [wilson_interval(int(k), 40) for k in draws]
        covered = np.mean([low <= 0.2 <= high for low, high in intervals])
        assert 0.92 < covered < 0.98

    def test_more_successes_than_trials_are_refused(self) -> None:
        with pytest.raises(ValueError, match="3 successes in 2 trials"):
            wilson_interval(3, 2)


class TestBootstrap:
    @given(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=30))
    def test_interval_lies_within_the_values(self, values: list[float]) -> None:
        low, high = bootstrap_mean_interval(values, np.ones(len(values)))
        slack = 1e-9 * max(1.0, *map(abs, values))
        assert min(values) - slack <= low <= high <= max(values) + slack

    def test_is_as_scipy_has_it_for_weighted_episodes(self) -> None:
        rng = np.random.default_rng(4)
        values, weights = rng.normal(size=60), rng.uniform(1.0, 20.0, 60)
        theirs = scipy.stats.bootstrap(
            (values, weights),
            lambda value, weight, axis: (value * weight).sum(axis=axis) / weight.sum(axis=axis),
            paired=True,
            method="percentile",
            rng=rng,
        ).confidence_interval
        assert bootstrap_mean_interval(values, weights) == pytest.approx(
            (theirs.low, theirs.high), abs=0.1 * (theirs.high - theirs.low)
        )

    def test_of_one_value_throughout_is_that_value_however_long_each_episode_was(self) -> None:
        weights = np.random.default_rng(8).uniform(1.0, 20.0, 12)
        assert bootstrap_mean_interval(np.full(12, 0.3), weights) == pytest.approx((0.3, 0.3), abs=1e-12)

    def test_shrinks_as_episodes_are_added(self) -> None:
        values = np.random.default_rng(0).normal(size=400)
        few = np.subtract(*bootstrap_mean_interval(values[:20], np.ones(20)))
        many = np.subtract(*bootstrap_mean_interval(values, np.ones(400)))
        assert abs(many) < 0.4 * abs(few)

    def test_covers_the_true_mean_about_95_times_in_100(self) -> None:
        rng = np.random.default_rng(2)
        intervals = [
            bootstrap_mean_interval(rng.normal(1.0, 1.0, 40), np.ones(40), seed=i) for i in range(200)
        ]
        assert 0.88 < np.mean([low <= 1.0 <= high for low, high in intervals]) < 0.99

    def test_the_same_seed_gives_the_same_interval(self) -> None:
        values, weights = np.random.default_rng(5).normal(size=30), np.ones(30)
        assert bootstrap_mean_interval(values, weights, 7) == bootstrap_mean_interval(values, weights, 7)

    def test_long_episodes_weigh_more_and_unmeasured_ones_nothing(self) -> None:
        assert weighted_mean([1.0, 3.0, np.nan], [3.0, 1.0, 5.0]) == 1.5
        assert math.isnan(weighted_mean([np.nan], [1.0]))
        assert math.isnan(weighted_mean([2.0, 3.0], [0.0, 0.0]))
        assert weighted_mean([1.0, 9.0], [2.0, np.inf]) == 1.0

    def test_an_episode_without_weight_is_none(self) -> None:
        values, weights = np.random.default_rng(6).normal(size=12), np.full(12, 3.0)
        alone = bootstrap_mean_interval(values, weights)
        assert bootstrap_mean_interval([*values, 99.0, np.nan], [*weights, 0.0, 5.0]) == alone
        assert bootstrap_mean_interval(values, weights, seed=1) != alone
        assert all(math.isnan(edge) for edge in bootstrap_mean_interval([1.0], [0.0]))


class TestSurvival:
    def test_finds_the_50_percent_point_it_was_drawn_from(self) -> None:
        rng = np.random.default_rng(3)
        pushes = np.tile(np.linspace(0.25, 3.0, 12), 40)
        survived = rng.random(len(pushes)) < 1 / (1 + np.exp((pushes - 1.4) / 0.2))
        fit = fit_survival(pushes, survived)
        assert fit.dv50 == pytest.approx(1.4, abs=0.1)
        assert fit.interval[0] < 1.4 < fit.interval[1]
        assert fit.interval[1] - fit.interval[0] < 0.3
        assert fit.width == pytest.approx(0.2, rel=0.4)

    def test_is_the_penalised_likelihoods_maximum_as_scipy_finds_it(self) -> None:
        pushes = np.array([0.5, 0.5, 1.0, 1.0, 1.5, 1.5, 1.5, 2.5, 2.5, 2.5])
        stood = np.array([1, 1, 1, 0, 1, 0, 1, 0, 0, 1])
        place = (pushes - 0.5) / 2.0

        def cost(coefficients: np.ndarray) -> float:
            offset, slope = coefficients
            score = offset + slope * place
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

    @pytest.mark.parametrize(("pushes", "stood"), [([], []), ([1.0], [True, False])])
    def test_as_many_outcomes_as_pushes_are_needed(self, pushes: list, stood: list) -> None:
        with pytest.raises(ValueError, match="as many outcomes"):
            fit_survival(pushes, stood)

    def test_survivors_and_fallen_that_do_not_overlap_meet_in_the_middle(self) -> None:
        fit = fit_survival([0.5, 1.0, 1.5, 2.0], [True, True, False, False])
        assert fit.dv50 == pytest.approx(1.25, abs=0.05)
        assert fit.chance(np.array([fit.dv50])) == pytest.approx(0.5)

    def test_chance_falls_with_the_push(self) -> None:
        fit = fit_survival([0.5, 1.0, 1.5, 2.0], [True, False, True, False])
        assert np.all(np.diff(fit.chance(np.linspace(0, 3, 20))) < 0)

    def test_who_stands_every_push_has_no_known_limit(self) -> None:
        fit = fit_survival([0.5, 1.0, 1.5], [True, True, True])
        assert fit.dv50 == math.inf
        assert fit.interval == (math.inf, math.inf)

    def test_who_falls_at_every_push_has_none_either(self) -> None:
        assert fit_survival([0.5, 1.0, 1.5], [False, False, False]).dv50 == 0.0

    def test_a_single_fall_at_the_strongest_push_is_not_extrapolated(self) -> None:
        fit = fit_survival([0.5, 1.0, 1.5, 2.0, 2.0, 2.0], [True, True, True, True, True, False])
        assert fit.dv50 == math.inf

    @given(st.lists(st.tuples(st.sampled_from([0.5, 1.0, 1.5, 2.0]), st.booleans()), min_size=1, max_size=20))
    def test_is_never_not_a_number(self, outcomes: list[tuple[float, bool]]) -> None:
        fit = fit_survival(*zip(*outcomes, strict=True))
        assert not math.isnan(fit.dv50)
        assert fit.interval[0] <= fit.interval[1]
