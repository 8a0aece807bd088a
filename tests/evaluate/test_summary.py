"""Figures of episodes, and their display."""

import json
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
from footfall.evaluate.summary import Summary, summarise
from footfall.robots.description import load_robot

SCENARIOS = load_scenarios(load_robot("go1")).scenarios
FELL = replace(GOOD, fell=True)


def nominal(*metrics: EpisodeMetrics) -> Summary:
    return summarise(SCENARIOS["nominal"], [outcome(m) for m in metrics], 0)


def haul(metrics: EpisodeMetrics) -> float:
    """Weight times distance, N m."""
    return metrics.weight_n * metrics.distance_m


class TestSummary:
    def test_times_to_get_up_are_reported_where_recovery_is_allowed(self) -> None:
        assert "recoveries" not in nominal(GOOD)
        for times_s, mean_s in (([(2.0, 3.0), (), (7.0,)], 4.0), ([(), ()], None)):
            summary = summarise(SCENARIOS["nominal"], [outcome(recovery_s=each) for each in times_s], 0)
            assert (summary["recoveries"], summary["recovery_s"]) == (sum(map(len, times_s)), mean_s)

    def test_each_mean_and_its_interval_are_of_its_own_values_and_weights(self) -> None:
        """The episodes differ in every number, so another column, weight or seed would give other figures."""
        rng = np.random.default_rng(8)
        numbers = [name for name, value in vars(GOOD).items() if isinstance(value, float)]
        drawn: list[dict[str, Any]] = [{n: float(rng.uniform(1.0, 3.0)) for n in numbers} for _ in range(9)]
        episodes = [replace(GOOD, **each) for each in drawn]
        summary = summarise(SCENARIOS["nominal"], [outcome(m) for m in episodes], 3)
        for name, measure, weigh, root in (
            ("lin_vel_rmse", lambda m: m.lin_vel_mse, lambda m: m.scored_s, True),
            ("yaw_rate_rmse", lambda m: m.yaw_rate_mse, lambda m: m.scored_s, True),
            ("estimate_rmse", lambda m: m.estimate_mse, lambda m: m.scored_s, True),
            ("target_rate_rad_s", lambda m: m.target_rate_rad_s**2, lambda m: m.walked_s, True),
            ("torque_rate_nm_s", lambda m: m.torque_rate_nm_s**2, lambda m: m.walked_s, True),
            ("foot_slip_m_s", lambda m: m.foot_slip_m_s, lambda m: m.stance_s, False),
            ("legs_touch_share", lambda m: m.legs_touch_share, lambda m: m.walked_s, False),
            ("cost_of_transport", lambda m: m.electrical_j / haul(m), haul, False),
            ("cost_of_transport_mechanical", lambda m: m.mechanical_j / haul(m), haul, False),
            ("positive_work_j_m", lambda m: m.positive_j / m.distance_m, lambda m: m.distance_m, False),
            ("positive_work_j", lambda m: m.positive_j, lambda _: 1.0, False),
        ):
            value, weight = (np.array([each(m) for m in episodes]) for each in (measure, weigh))
            transform = np.sqrt if root else np.asarray
            assert summary[name] == pytest.approx(float(transform(value @ weight / weight.sum()))), name
            if name != "positive_work_j":
                edges = [float(transform(edge)) for edge in bootstrap_mean_interval(value, weight, 3)]
                assert summary[f"{name}_interval"] == pytest.approx(edges), name

    def test_cost_of_transport_needs_some_distance(self) -> None:
        assert nominal(replace(GOOD, distance_m=0.1))["cost_of_transport"] is None
        assert nominal(replace(GOOD, distance_m=0.11))["cost_of_transport"] == pytest.approx(625 / 125 / 0.11)

    def test_a_row_has_the_figures_of_its_own_episodes(self) -> None:
        careless = replace(FELL, lin_vel_mse=0.25, yaw_rate_mse=0.49, electrical_j=1250.0)
        results = [(GOOD, 1.0), (careless, 2.0), (careless, 2.0)]
        rows = summarise(SCENARIOS["push"], [outcome(m, push) for m, push in results], 0)["rows"]
        assert [row["lin_vel_rmse"] for row in rows] == pytest.approx([0.1, 0.5])
        assert [row["yaw_rate_rmse"] for row in rows] == pytest.approx([0.2, 0.7])
        assert [row["cost_of_transport"] for row in rows] == pytest.approx([1.0, 2.0])
        assert set(rows[0]) == {
            "push_m_s", "episodes", "falls", "fall_rate_interval", "lin_vel_rmse", "yaw_rate_rmse",
            "cost_of_transport",
        }  # fmt: skip

    def test_successes_are_counted_on_ground_that_is_not_level(self) -> None:
        tried = ((GOOD, 0.1), (replace(GOOD, progress=0.5), 0.2), (FELL, 0.2))
        outcomes = [outcome(metrics, levels={"step_m": step}) for metrics, step in tried]
        summary = summarise(SCENARIOS["stairs"], outcomes, 0)
        assert (summary["successes"], [row["successes"] for row in summary["rows"]]) == (1, [1, 0])
        assert text(figures()["successes"], summary) == "1 of 3"

    def test_an_episode_that_raised_is_named_and_not_counted(self) -> None:
        died = TaskResult[Any](None, "its process died")
        summary = summarise(SCENARIOS["nominal"], [outcome(), died], 0)
        assert (summary["episodes"], summary["failed_episodes"]) == (1, ["episode 1: its process died"])
        alone = summarise(SCENARIOS["push"], [died], 0)  # without any figures
        assert alone == {"episodes": 0, "failed_episodes": ["episode 0: its process died"]}

    def test_a_summary_is_plain_json_without_nan(self) -> None:
        never_settled = replace(GOOD, scored_s=0.0, lin_vel_mse=np.nan, mean_velocity=(np.nan,) * 3)
        json.dumps(nominal(never_settled), allow_nan=False)

    def test_pushes_give_the_50_percent_point_and_a_row_for_each_size(self) -> None:
        outcomes = [outcome(GOOD if push < 1.2 else FELL, push) for push in (0.5, 1.0, 1.5, 2.0) * 4]
        summary = summarise(SCENARIOS["push"], outcomes, 0)
        assert summary["dv50"] == pytest.approx(1.25, abs=0.05)
        low, high = summary["dv50_interval"]
        assert 1.0 < low <= summary["dv50"] <= high < 1.5
        rows = [(row["push_m_s"], row["falls"], row["episodes"]) for row in summary["rows"]]
        assert rows == [(0.5, 0, 4), (1.0, 0, 4), (1.5, 4, 4), (2.0, 4, 4)]
        assert summary["rows"][3]["fall_rate_interval"] == pytest.approx([0.5101, 1.0], abs=1e-4)


def test_falls_and_pushes_beyond_the_strongest_are_shown() -> None:
    summary = nominal(GOOD, FELL)
    falls, dv50 = figures()["falls"], figures()["dv50"]
    assert (text(falls, summary), interval_text(falls, summary)) == ("1 of 2", "9 to 91 %")
    strong, weak = (
        summarise(SCENARIOS["push"], [outcome(each, push) for push in (0.5, 1.5)], 0) for each in (GOOD, FELL)
    )
    assert (text(dv50, strong), interval_text(dv50, strong)) == ("above 1.5", "")
    assert text(dv50, weak) == "below 0.5"
