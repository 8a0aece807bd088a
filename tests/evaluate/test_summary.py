"""Figures of episodes, and their display."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from outcomes import GOOD, outcome

from footfall.evaluate.figures import figures, interval_text, text
from footfall.evaluate.metrics import EpisodeMetrics
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.scenarios import load_scenarios
from footfall.evaluate.statistics import bootstrap_mean_interval
from footfall.evaluate.summary import Summary, compute_figures, summarise
from footfall.robots.description import load_robot

SCENARIOS = load_scenarios(load_robot("go1")).scenarios


FELL = replace(GOOD, fell=True)


def nominal(*metrics: EpisodeMetrics) -> Summary:
    return summarise(SCENARIOS["nominal"], [outcome(m) for m in metrics], 0)


class TestSummary:
    def test_counts_falls_with_their_interval(self) -> None:
        summary = nominal(GOOD, FELL, GOOD, GOOD)
        assert (summary["episodes"], summary["falls"], summary["fall_rate"]) == (4, 1, 0.25)
        low, high = summary["fall_rate_interval"]
        assert 0.0 < low < 0.25 < high < 1.0

    def test_times_to_get_up_are_reported_where_recovery_is_allowed(self) -> None:
        assert "recoveries" not in nominal(GOOD)
        for times_s, mean_s in (([(2.0, 3.0), (), (7.0,)], 4.0), ([(), ()], None)):
            summary = summarise(SCENARIOS["nominal"], [outcome(recovery_s=each) for each in times_s], 0)
            assert (summary["recoveries"], summary["recovery_s"]) == (sum(map(len, times_s)), mean_s)

    def test_mean_velocity_is_over_the_scored_time_of_all_episodes(self) -> None:
        short_and_still = replace(GOOD, scored_s=2.0, mean_velocity=(0.0, 1.0, -0.5))
        assert nominal(GOOD, short_and_still)["mean_velocity"] == pytest.approx([0.4, 0.2, -0.1])

    def test_slip_is_over_the_time_of_stance_and_peaks_are_of_the_worst_episode(self) -> None:
        slipping = replace(
            GOOD, stance_s=60.0, foot_slip_m_s=0.25, peak_torque_nm=33.0, peak_torque_share=1.0
        )
        summary = nominal(GOOD, slipping, GOOD)
        assert summary["foot_slip_m_s"] == pytest.approx((20 * 0.05 + 60 * 0.25 + 20 * 0.05) / 100)
        assert (summary["peak_torque_nm"], summary["peak_torque_share"]) == (33.0, 1.0)

    @pytest.mark.parametrize(
        ("name", "values", "weights", "root"),
        [
            ("lin_vel_rmse", "lin_vel_mse", lambda m: m.scored_s, True),
            ("yaw_rate_rmse", "yaw_rate_mse", lambda m: m.scored_s, True),
            ("estimate_rmse", "estimate_mse", lambda m: m.scored_s, True),
            ("target_rate_rad_s", lambda m: m.target_rate_rad_s**2, lambda m: m.walked_s, True),
            ("torque_rate_nm_s", lambda m: m.torque_rate_nm_s**2, lambda m: m.walked_s, True),
            ("foot_slip_m_s", "foot_slip_m_s", lambda m: m.stance_s, False),
            ("legs_touch_share", "legs_touch_share", lambda m: m.walked_s, False),
            (
                "cost_of_transport",
                lambda m: m.electrical_j / (m.weight_n * m.distance_m),
                lambda m: m.weight_n * m.distance_m,
                False,
            ),
            (
                "cost_of_transport_mechanical",
                lambda m: m.mechanical_j / (m.weight_n * m.distance_m),
                lambda m: m.weight_n * m.distance_m,
                False,
            ),
            ("positive_work_j_m", lambda m: m.positive_j / m.distance_m, lambda m: m.distance_m, False),
            ("positive_work_j", "positive_j", lambda _: 1.0, False),
        ],
    )
    def test_each_mean_and_its_interval_are_of_its_own_values_and_weights(
        self, name: str, values: str | Callable, weights: Callable, root: bool
    ) -> None:
        """Episodes that differ in every number: another column, weight or seed would give other figures."""
        rng = np.random.default_rng(8)
        numbers = [name for name, value in vars(GOOD).items() if isinstance(value, float)]
        drawn: list[dict[str, Any]] = [{n: float(rng.uniform(1.0, 3.0)) for n in numbers} for _ in range(9)]
        episodes = [replace(GOOD, **each) for each in drawn]
        summary = summarise(SCENARIOS["nominal"], [outcome(m) for m in episodes], 3)
        measure = values if callable(values) else lambda m: getattr(m, values)
        value, weight = (np.array([each(m) for m in episodes]) for each in (measure, weights))
        transform = np.sqrt if root else np.asarray
        assert summary[name] == pytest.approx(float(transform(value @ weight / weight.sum())))
        if name != "positive_work_j":
            edges = bootstrap_mean_interval(value, weight, 3)
            assert summary[f"{name}_interval"] == pytest.approx([float(transform(edge)) for edge in edges])

    def test_cost_of_transport_needs_some_distance(self) -> None:
        assert nominal(replace(GOOD, distance_m=0.1))["cost_of_transport"] is None
        assert nominal(replace(GOOD, distance_m=0.11))["cost_of_transport"] == pytest.approx(625 / 125 / 0.11)

    def test_time_per_step_is_of_all_steps_of_all_episodes(self) -> None:
        quick, slow = (outcome(compute_ms=ms) for ms in (np.arange(1.0, 52.0), np.arange(52.0, 102.0)))
        summary = summarise(SCENARIOS["nominal"], [quick, slow], 0)
        assert summary["compute_ms"] == {"p50": 51.0, "p99": 100.0}
        assert summary["missed_deadlines"] == pytest.approx(81 / 101)  # a step of just 20 ms is in time
        assert compute_figures(np.zeros(0), 20.0) == {
            "compute_ms": {"p50": None, "p99": None},
            "missed_deadlines": None,
        }

    def test_notes_are_shown_once_and_in_order(self) -> None:
        said = (("no floor", "h", "d"), ("no base", "no floor", "a"), (), ("c", "g", "a"), ("e", "b", "f"))
        noted = [outcome(notes=notes) for notes in said]
        assert summarise(SCENARIOS["nominal"], noted, 0)["notes"] == [*"abcdefgh", "no base", "no floor"]

    def test_a_row_has_the_figures_of_its_own_episodes(self) -> None:
        careless = replace(FELL, lin_vel_mse=0.25, yaw_rate_mse=0.49, electrical_j=1250.0)
        met = [(GOOD, 1.0), (careless, 2.0), (careless, 2.0)]
        rows = summarise(SCENARIOS["push"], [outcome(m, push) for m, push in met], 0)["rows"]
        assert [row["lin_vel_rmse"] for row in rows] == pytest.approx([0.1, 0.5])
        assert [row["yaw_rate_rmse"] for row in rows] == pytest.approx([0.2, 0.7])
        assert [row["cost_of_transport"] for row in rows] == pytest.approx([1.0, 2.0])
        assert set(rows[0]) == {
            "push_m_s", "episodes", "falls", "fall_rate_interval", "lin_vel_rmse", "yaw_rate_rmse",
            "cost_of_transport",
        }  # fmt: skip

    def test_the_strongest_push_is_reported_and_no_median_below_the_weakest(self) -> None:
        weak = summarise(SCENARIOS["push"], [outcome(FELL, push) for push in (1.5, 0.5)], 0)
        assert (weak["strongest_push"], weak["dv50"]) == (1.5, None)
        assert "dv50" not in nominal(GOOD)

    def test_emergency_stops_are_counted_among_the_falls(self) -> None:
        summary = nominal(GOOD, FELL, replace(FELL, emergency_stop=True))
        assert (summary["falls"], summary["emergency_stops"]) == (2, 1)

    def test_episodes_in_which_legs_touch_are_counted(self) -> None:
        summary = nominal(
            GOOD, replace(GOOD, legs_touch_share=0.001), GOOD, replace(GOOD, legs_touch_share=0.5)
        )
        assert summary["legs_touch_episodes"] == 2
        assert text(figures()["legs_touch_episodes"], summary) == "2 of 4"

    def test_successes_are_counted_on_ground_that_is_not_level(self) -> None:
        good, stuck, fallen = (
            replace(GOOD, **changes) for changes in ({}, {"progress": 0.5}, {"fell": True})
        )
        tried = ((good, 0.1), (stuck, 0.2), (fallen, 0.2))
        outcomes = [outcome(metrics, levels={"step_m": step}) for metrics, step in tried]
        summary = summarise(SCENARIOS["stairs"], outcomes, 0)
        assert (summary["successes"], [row["successes"] for row in summary["rows"]]) == (1, [1, 0])
        assert text(figures()["successes"], summary) == "1 of 3"

    def test_a_command_that_holds_throughout_gives_a_mean_speed(self) -> None:
        assert summarise(SCENARIOS["forward"], [outcome()], 0)["mean_forward_m_s"] == 0.5
        assert "mean_forward_m_s" not in nominal(GOOD)
        scripted = replace(SCENARIOS["forward"], levels={"friction": (0.5,)})
        assert "mean_forward_m_s" not in summarise(scripted, [outcome()], 0)

    def test_an_episode_that_raised_is_named_and_not_counted(self) -> None:
        summary = summarise(SCENARIOS["nominal"], [outcome(), TaskResult(None, "its process died")], 0)
        assert summary["episodes"] == 1
        assert summary["failed_episodes"] == ["episode 1: its process died"]

    def test_failed_episodes_alone_give_no_figures(self) -> None:
        summary = summarise(SCENARIOS["push"], [TaskResult(None, "ValueError: no")], 0)
        assert summary == {"episodes": 0, "failed_episodes": ["episode 0: ValueError: no"]}

    def test_is_plain_json_without_nan(self) -> None:
        never_settled = replace(GOOD, scored_s=0.0, lin_vel_mse=np.nan, mean_velocity=(np.nan,) * 3)
        json.dumps(nominal(never_settled), allow_nan=False)

    def test_pushes_give_the_50_percent_point_and_a_row_for_each_size(self) -> None:
        outcomes = [outcome(GOOD if push < 1.2 else FELL, push) for push in (0.5, 1.0, 1.5, 2.0) * 4]
        summary = summarise(SCENARIOS["push"], outcomes, 0)
        assert summary["dv50"] == pytest.approx(1.25, abs=0.05)
        low, high = summary["dv50_interval"]
        assert 1.0 < low <= summary["dv50"] <= high < 1.5
        assert [(row["push_m_s"], row["falls"]) for row in summary["rows"]] == [
            (0.5, 0),
            (1.0, 0),
            (1.5, 4),
            (2.0, 4),
        ]
        assert [row["episodes"] for row in summary["rows"]] == [4, 4, 4, 4]
        assert summary["rows"][3]["fall_rate_interval"] == pytest.approx([0.5101, 1.0], abs=1e-4)

    def test_rows_of_two_levels_are_named_by_both(self) -> None:
        levels = {"forward_m_s": 2.0, "yaw_rad_s": -1.0}
        (row,) = summarise(SCENARIOS["sweep"], [outcome(levels=levels)], 0)["rows"]
        assert (row["forward_m_s"], row["yaw_rad_s"]) == (2.0, -1.0)

    def test_rows_are_sorted_by_level(self) -> None:
        met = [outcome(levels={"friction": friction}) for friction in (0.6, 0.2, 1.2)]
        rows = summarise(SCENARIOS["friction"], met, 0)["rows"]
        assert [row["friction"] for row in rows] == [0.2, 0.6, 1.2]

    def test_reasons_are_listed_in_the_alphabets_order(self) -> None:
        outcomes = [
            outcome(FELL, trouble=reason) for reason in ("tilted", "base down", "tilted", "motor off")
        ]
        troubles = summarise(SCENARIOS["nominal"], outcomes, 0)["troubles"]
        assert list(troubles.items()) == [("base down", 1), ("motor off", 1), ("tilted", 2)]


class TestShowing:
    def test_falls_are_shown_out_of_how_many(self) -> None:
        summary = nominal(GOOD, FELL)
        assert text(figures()["falls"], summary) == "1 of 2"
        assert interval_text(figures()["falls"], summary) == "9 to 91 %"

    def test_a_policy_that_survives_all_pushes_is_above_the_strongest(self) -> None:
        strong = summarise(SCENARIOS["push"], [outcome(GOOD, p) for p in (0.5, 1.5)], 0)
        none = summarise(SCENARIOS["push"], [outcome(FELL, p) for p in (0.5, 1.5)], 0)
        assert text(figures()["dv50"], strong) == "above 1.5"
        assert text(figures()["dv50"], none) == "below 0.5"
        assert interval_text(figures()["dv50"], strong) == ""
