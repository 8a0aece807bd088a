"""The status text of the page."""

from dataclasses import replace

import numpy as np

from footfall.pages.status import WAITING, Status, as_markdown

WALKING = Status("go1", "runs/mine", 2000, 10, trained_steps=500, metrics_age_s=3.0, iteration=30, policies=1)


def test_the_awaited_policy_is_shown() -> None:
    nothing = replace(WALKING, policies=0, iteration=None, metrics_age_s=None)
    assert WAITING in as_markdown(nothing)
    assert "Policy" not in as_markdown(nothing)
    assert "1,200" in as_markdown(replace(nothing, exporting=1200))


def test_a_training_without_news_for_two_minutes_is_reported_unless_finished() -> None:
    for age_s, finished, quiet in ((120.0, False, False), (120.1, False, True), (999.0, True, False)):
        text = as_markdown(replace(WALKING, metrics_age_s=age_s, finished=finished))
        assert ("train --resume runs/mine" in text) is quiet
    done = as_markdown(replace(WALKING, finished=True, trained_steps=2000, metrics_age_s=7300.0))
    assert "2,000 steps, 2 h" in done


def test_the_status_shows_the_walking_policy_and_its_tracking_error() -> None:
    text = as_markdown(
        replace(
            WALKING, command=np.array([0.5, 0.0, 0.0]), velocity=np.array([0.42, -0.01, 0.0]), mode="WALKING",
            episodes=4, falls=3, last_fall="the base tilted", walked_s=12.0, restart_s=60.0,
        )
    )  # fmt: skip
    facts = ("500 of 2,000 steps (25%)", "iteration 30", "+0.42 of +0.50 m/s", "3 in 4", "the base tilted")
    assert [fact for fact in (*facts, "12 of 60 s") if fact not in text] == []
    assert WAITING not in text
