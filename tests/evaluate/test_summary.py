"""Figures of episodes, and their display."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from outcomes import GOOD, outcome

from footfall.evaluate.failures import failures
from footfall.evaluate.figures import beats, best, figures, interval, interval_text, leaders, text, value
from footfall.evaluate.metrics import EpisodeMetrics
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.scenarios import load_scenarios
from footfall.evaluate.statistics import bootstrap_mean_interval, wilson_interval
from footfall.evaluate.summary import Summary, summarise
from footfall.evaluate.table import warnings
from footfall.evaluate.verdict import verdict
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


ERROR, FALLS, PUSH = (figures()[key] for key in ("lin_vel_rmse", "falls", "dv50"))


def scored(error: float, half_width: float = 0.0, falls: int = 0, episodes: int = 24, **more: Any) -> dict:
    """A scenario's summary with one measured figure."""
    return {
        "episodes": episodes, "falls": falls, "fall_rate": falls / episodes,
        "fall_rate_interval": list(wilson_interval(falls, episodes)),
        "lin_vel_rmse": error, "lin_vel_rmse_interval": [error - half_width, error + half_width], **more,
    }  # fmt: skip


def pushed(dv50: float | None, low: float | None, high: float | None, falls: int = 48) -> dict:
    """A push scenario's summary; None stands for beyond the strongest push, 5 m/s."""
    median = {"dv50": dv50, "dv50_interval": [low, high], "weakest_push": 0.5, "strongest_push": 5.0}
    return scored(1.0, 1.0, falls, 96) | median


def test_figures_that_favour_a_fallen_robot_are_blocked_by_falls() -> None:
    assert {key for key, figure in figures().items() if figure.blocked_by_falls} == {
        *("lin_vel_rmse", "yaw_rate_rmse", "cost_of_transport", "cost_of_transport_mechanical"),
        *("positive_work_j_m", "peak_torque_share", "foot_slip_m_s", "torque_rate_nm_s"),
        "legs_touch_share",
    }


def test_best_is_the_policy_whose_interval_overlaps_no_other() -> None:
    unmoved, weak = pushed(None, None, None, falls=0), pushed(1.0, 0.8, 1.2)
    failed = {"episodes": 0, "failed_episodes": ["episode 0: no"]}
    torque, share = figures()["peak_torque_nm"], figures()["peak_torque_share"]
    for figure, summaries, expected in (
        (ERROR, [scored(0.3, 0.02), scored(0.1, 0.02), scored(0.2, 0.02)], 1),
        (ERROR, [scored(0.30, 0.06), scored(0.20, 0.06)], None),
        (FALLS, [scored(0.1, falls=4), scored(0.1, falls=5)], None),
        (PUSH, [weak, unmoved], 1), (PUSH, [unmoved, unmoved], None),  # survived all pushes
        (ERROR, [scored(0.1, 0.01, falls=1), scored(0.5, 0.01)], None),  # it fell early
        (ERROR, [scored(0.1, 0.01, falls=1), scored(0.5, 0.01, falls=1)], 0),
        (ERROR, [scored(0.1, episodes=7), scored(0.5, episodes=7)], None),  # too few episodes
        (ERROR, [scored(0.1, episodes=8), scored(0.5, episodes=8)], 0),
        (ERROR, [scored(0.1, episodes=24), scored(0.5, episodes=7)], None),
        (torque, [scored(0.1) | {"peak_torque_nm": each} for each in (10.0, 20.0)], None),  # no better side
        (share, [scored(0.1) | {"peak_torque_share": each} for each in (0.5, 1.0)], None),  # no interval
        (ERROR, [scored(0.10, 0.02), scored(0.50, 0.02), scored(0.11, 0.02)], None),  # two lead together
        (ERROR, [failed, scored(0.1)], None),
    ):  # fmt: skip
        assert best(figure, summaries) == expected, summaries
    assert leaders(ERROR, [scored(0.10, 0.02), scored(0.50, 0.02), scored(0.11, 0.02)]) == {0, 2}
    assert leaders(FALLS, [failed, scored(0.1)]) == set()


def test_a_push_may_be_beyond_all_pushes() -> None:
    beyond = (math.inf, math.inf)
    for summary, number, shown, edges, between in (
        (pushed(None, None, None, falls=47), math.inf, "above 5", beyond, ""),
        (pushed(None, None, None, falls=48), None, "below 0.5", beyond, ""),
        (pushed(2.0, 1.8, None), 2.0, "2.00", (1.8, math.inf), "1.80 to beyond"),
        (pushed(2.0, 1.8, 2.25), 2.0, "2.00", (1.8, 2.25), "1.80 to 2.25"),
        (pushed(None, None, None, falls=0), math.inf, "above 5", beyond, ""),
    ):
        assert (value(PUSH, summary), text(PUSH, summary)) == (number, shown)
        assert (interval(PUSH, summary), interval_text(PUSH, summary)) == (edges, between)


def test_touching_intervals_overlap() -> None:
    def edges(low: float, high: float, **more: Any) -> dict:
        both = {"lin_vel_rmse_interval": [low, high], "dv50": 1.0, "dv50_interval": [low, high]}
        return scored(0.5, **more) | both

    for figure, one, other, better in (
        (ERROR, edges(0.1, 0.2), edges(0.2, 0.3), False),
        (ERROR, edges(0.1, 0.2), edges(0.21, 0.3), True),
        (PUSH, edges(0.21, 0.3), edges(0.1, 0.2), True),
        (PUSH, edges(0.2, 0.3), edges(0.1, 0.2), False),
        (PUSH, edges(0.21, 0.3, falls=9), edges(0.1, 0.2), True),  # pushes are judged by falls
        (ERROR, edges(0.1, 0.2, falls=3), edges(0.3, 0.4, falls=3), True),
        (ERROR, edges(0.1, 0.2, falls=4), edges(0.3, 0.4, falls=3), False),
    ):
        assert beats(figure, one, other) is better


def test_the_verdict_compares_the_best_with_the_second_best() -> None:
    pushes = {"c": pushed(1.0, 0.9, 1.1), "b": pushed(2.0, 1.9, 2.1), "a": pushed(3.0, 2.9, 3.1)}
    errors = {"c": scored(0.9), "b": scored(0.5), "a": scored(0.1)}
    unknown = scored(0.9) | {"lin_vel_rmse": None, "lin_vel_rmse_interval": [None, None]}
    alike = {"a": scored(0.10, 0.02), "b": scored(0.11, 0.02), "c": scored(0.5, 0.02)}
    fallen = {"a": scored(0.1, 0.01, falls=3), "b": scored(0.3, 0.01)}
    for scenario, summaries, parts in (
        ("push", pushes, ["(3.00 m/s, against 2.00 of b)"]),
        ("nominal", errors, ["(0.100 m/s, against 0.500 of b)"]),
        ("nominal", errors | {"c": unknown}, ["(0.100 m/s, against 0.500 of b)"]),
        ("nominal", alike, ["a and b", "0.100 and 0.110 m/s"]),
        ("nominal", fallen, ["a leads in velocity error but falls more often"]),
    ):
        sentence = verdict({scenario: summaries})
        assert [part for part in parts if part not in sentence] == [], sentence


def test_notes_that_differ_in_their_figures_are_one_line() -> None:
    trained = [f"trained on 1 m/s: {count} became 1" for count in (3, 2, 4)]
    notes = [*trained[:2], "no floor", trained[2]]
    results = {"mine": {"scenarios": {"nominal": {"failed_episodes": [], "notes": notes}}}}
    assert warnings(results) == ["no floor", "trained on 1 m/s: 2 became 1, and 2 more"]


def test_failures_are_counted_by_reason() -> None:
    for failed, line in (
        ([], ""),
        (["episode 1: ValueError: no: never"], "1 of 25 episodes failed: ValueError: no: never (1)"),
        (["episode 0: b", "episode 1: a", "episode 2: a"], "3 of 27 episodes failed: a (2); b (1)"),
        ([f"episode {i}: {i}" for i in range(5)], "0 (1); 1 (1); 2 (1); 2 more reasons"),
    ):
        found = failures([{"episodes": 24, "failed_episodes": failed}])
        assert found.endswith(line)
        assert bool(found) == bool(line)
