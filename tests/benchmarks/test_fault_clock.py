"""The table of faults that need a wall clock, and the loop's timing."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import fault_clock
import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from fault_clock import AddedDelay, TimingFault
from realtime import BUDGET_US, Stages
from relaxed_limits import RELAXED

from footfall.plant.episode import run_episode
from footfall.robots.description import Robot

RUN = {"fault": "it ran late", "seconds": 0.12, "final_state": "ESTOP", "fell": False}


def kind(within_s: float | None) -> TimingFault:
    return TimingFault("a pause", AddedDelay, within_s, "a guard")


@pytest.mark.parametrize(
    ("within_s", "changes", "expected"),
    [
        (0.12, {}, True),
        (0.11, {}, False),
        (0.12, {"seconds": None}, False),  # a reaction before the fault occurred
        (None, {}, False),
        (None, {"fault": "", "seconds": None}, True),
        (None, {"fault": "", "seconds": None, "fell": True}, False),
    ],
)
def test_a_row_is_as_expected_if_all_its_runs_are(
    within_s: float | None, changes: dict[str, Any], expected: bool
) -> None:
    good = {**RUN} if within_s else {**RUN, "fault": "", "seconds": None}
    assert fault_clock.as_expected(kind(within_s), [good, {**RUN, **changes}]) is expected


def test_a_row_has_reaction_time_and_outcome() -> None:
    slow = {**RUN, "seconds": 0.14}
    line = "| a pause | 2/2 | 130, 140 (150) | ESTOP 2 | 0 | it ran late | a guard |"
    assert fault_clock.row(kind(0.15), [RUN, slow]) == line
    assert "**it ran late**" in fault_clock.row(kind(0.1), [RUN, slow])


def test_a_pause_is_damped_by_the_guard_before_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """The loop has 50 ticks a second and relaxed limits, so that a busy machine passes, too."""
    relaxed = replace(RELAXED.safety, silence_timeout_s=5.0, late_limit_s=0.5, pause_limit_s=0.5)
    config = replace(RELAXED, safety=relaxed)
    monkeypatch.setattr(fault_clock, "deploy_config", lambda _: config)
    monkeypatch.setattr(fault_clock, "STAND_S", 0.3)
    monkeypatch.setattr(fault_clock, "AT_S", 0.1)
    pause = kind(1.0)._replace(delay=lambda: AddedDelay(in_tick_s=1.2, once=True))
    run = fault_clock.run(pause, 0, 50.0)
    assert "a guard damped the robot" in run["fault"]
    assert 0.3 < run["seconds"] < 1.2  # 0.55 s after the beginning of a tick that pauses at its end
    assert run["final_state"] == "ESTOP"
    assert np.isfinite(run["skipped_share"])


def test_every_stage_of_a_run_is_timed(go1: Robot, tmp_path: Path) -> None:
    stages = Stages()
    watched = {"log": tmp_path / "run.mcap", "display": lambda loop, velocity: stages.watch(loop)}
    run_episode(go1, Hold(go1), short_episode(duration_s=0.1, **watched))
    assert set(stages.summary()) >= set(BUDGET_US) - {"plant", "estimator"}
    assert all(found["p99"] > 0.0 for found in stages.summary().values())
