"""The better policy, by intervals: the mark of the best, and the sentence that opens a report."""

import math
from typing import Any

from footfall.evaluate.failures import failures
from footfall.evaluate.figures import beats, best, figures, interval, interval_text, leaders, text, value
from footfall.evaluate.statistics import wilson_interval
from footfall.evaluate.table import warnings
from footfall.evaluate.verdict import verdict

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
        (PUSH, [weak, unmoved], 1),  # the second policy survived all pushes
        (PUSH, [unmoved, unmoved], None),
        (ERROR, [scored(0.1, 0.01, falls=1), scored(0.5, 0.01)], None),  # it fell early
        (ERROR, [scored(0.1, 0.01, falls=1), scored(0.5, 0.01, falls=1)], 0),
        (ERROR, [scored(0.1, episodes=7), scored(0.5, episodes=7)], None),  # too few episodes
        (ERROR, [scored(0.1, episodes=8), scored(0.5, episodes=8)], 0),
        (ERROR, [scored(0.1, episodes=24), scored(0.5, episodes=7)], None),
        (torque, [scored(0.1) | {"peak_torque_nm": each} for each in (10.0, 20.0)], None),  # no better side
        (share, [scored(0.1) | {"peak_torque_share": each} for each in (0.5, 1.0)], None),  # no interval
        (ERROR, [scored(0.10, 0.02), scored(0.50, 0.02), scored(0.11, 0.02)], None),  # two lead together
        (ERROR, [failed, scored(0.1)], None),
    ):
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
    for scenario, summaries, parts in (
        ("push", pushes, ["(3.00 m/s, against 2.00 of b)"]),
        ("nominal", errors, ["(0.100 m/s, against 0.500 of b)"]),
        ("nominal", errors | {"c": unknown}, ["(0.100 m/s, against 0.500 of b)"]),
        ("nominal", alike, ["a and b", "0.100 and 0.110 m/s"]),
        (
            "nominal",
            {"a": scored(0.1, 0.01, falls=3), "b": scored(0.3, 0.01)},
            ["a leads in velocity error but falls more often"],
        ),
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
