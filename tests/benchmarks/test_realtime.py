"""The benchmark of the loop's timing: it measures all parts of the current loop."""

from pathlib import Path

from deploy_policies import Hold, short_episode
from realtime import BUDGET_US, Stages

from footfall.plant.episode import run_episode
from footfall.robots.description import Robot


def test_every_stage_of_a_run_is_timed(go1: Robot, tmp_path: Path) -> None:
    stages = Stages()
    episode = short_episode(
        duration_s=0.1, log=tmp_path / "run.mcap", display=lambda loop, velocity: stages.watch(loop)
    )
    run_episode(go1, Hold(go1), episode)
    assert set(stages.summary()) >= set(BUDGET_US) - {"plant", "estimator"}
    assert all(found["p99"] > 0.0 for found in stages.summary().values())
