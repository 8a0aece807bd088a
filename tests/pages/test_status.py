"""The status text of the page."""

from typing import Any

import numpy as np

from footfall.pages.status import WAITING, Status, as_markdown


class TestStatus:
    def status(self, **changes: Any) -> Status:
        plain = Status(
            "go1, smoke",
            "runs/mine",
            2000,
            16,
            trained_steps=500,
            metrics_age_s=3.0,
            iteration=30,
            policies=1,
        )
        for name, value in changes.items():
            setattr(plain, name, value)
        return plain

    def test_the_awaited_policy_is_shown(self) -> None:
        nothing = self.status(policies=0, iteration=None, metrics_age_s=None)
        assert "**waiting for the first checkpoint**" in as_markdown(nothing)
        assert "| Training | no metrics yet |" in as_markdown(nothing)
        assert "| Policy |" not in as_markdown(nothing)
        assert "yet" not in as_markdown(self.status(metrics_age_s=None, finished=True))
        for iteration, result in ((0, "0"), (1200, "1,200")):
            nothing.exporting = iteration
            assert f"**preparing the policy of iteration {result}**" in as_markdown(nothing)

    def test_a_training_is_quiet_after_two_minutes_unless_it_is_finished(self) -> None:
        def result(age_s: float, finished: bool) -> bool:
            return "train --resume runs/mine" in as_markdown(
                self.status(metrics_age_s=age_s, finished=finished)
            )

        assert [result(120.0, False), result(120.1, False), result(999.0, True)] == [False, True, False]
        done = as_markdown(self.status(finished=True, trained_steps=2000, metrics_age_s=7300.0))
        assert "| Training | **finished** after 2,000 steps, 2 h ago |" in done

    def test_shows_the_walking_policy_and_its_tracking_error(self) -> None:
        status = Status(
            "go1", "runs/mine", 1000, 10, trained_steps=500, metrics_age_s=2.0, iteration=30, policies=3
        )
        status.command, status.velocity = np.array([0.5, 0.0, 0.0]), np.array([0.42, -0.01, 0.0])
        status.mode, status.episodes, status.falls, status.last_fall = "WALKING", 4, 3, "the base tilted"
        status.walked_s, status.restart_s = 12.0, 60.0
        text = as_markdown(status)
        assert WAITING not in text
        for fact in (
            "500 of 1,000 steps (50%)", "iteration 30, 300 steps", "+0.42 of +0.50 m/s",
            "3 in 4 starts: the base tilted", "walking", "12 of 60 s",
        ):  # fmt: skip
            assert fact in text
