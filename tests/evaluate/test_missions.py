"""Missions as scenarios."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation
from traces import walk

from footfall.common.errors import UserError
from footfall.deploy.command_source import Pose
from footfall.domain_rand.noise import Noise
from footfall.evaluate.api import evaluate_policy
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.episodes import EpisodeOutcome, EpisodeTask, run_task
from footfall.evaluate.missions import MissionScore, mission_figures, score_mission
from footfall.evaluate.plan import plan_episodes
from footfall.evaluate.scenarios import DrawnCommands, Scenario
from footfall.evaluation_options import EvaluationOptions, evaluation_config, requirements_of
from footfall.operate.missions.run import mission_run
from footfall.operate.missions.source import DONE, Progress

QUIET = Noise(joint_position=0.0, joint_velocity=0.0, gyro=0.0, gravity=0.0)


def run(steps: list[Any], duration_s: float = 20.0) -> EpisodeOutcome:
    (plan,) = plan_episodes("errand", Scenario("", 1, duration_s, mission={"steps": steps}), seed=3)
    return run_task(EpisodeTask("go1-flat", "go1", plan, QUIET, mission_run=mission_run))


def test_a_mission_steers_and_its_final_position_is_scored() -> None:
    outcome = run([{"go_to": [0.4, 0.0]}, {"policy": "stand"}, {"wait": 0.1}])
    assert outcome.mission is not None
    assert (outcome.mission.done, outcome.mission.arrived, outcome.trouble) == (True, True, "")
    assert 0.5 < outcome.mission.lasted_s < 10.0
    assert outcome.metrics.distance_m > 0.3


def test_an_unfinished_mission_has_its_reason() -> None:
    slow = {"go_to": {"to": [0.4, 0.0], "timeout_s": 0.3}}
    for step, duration_s, why in (
        (slow, 20.0, "step 1 (go_to): it takes longer than 0 s"),
        ({"wait": 20.0}, 0.3, "not over in time"),
    ):
        outcome = run([step], duration_s)
        assert outcome.mission is not None
        assert (outcome.mission.done, outcome.metrics.fell) == (False, False)
        assert why in outcome.trouble


def test_the_final_error_is_from_ground_truth_in_the_frame_of_the_start() -> None:
    progress = Progress(1, 1, "go_to", 0.0, 0.0, 0.0, DONE)
    finished: Any = SimpleNamespace(progress=progress, goal=Pose(2.0, 0.0, 0.0))  # without odometry error
    trace = walk(2.21)
    for yaw_rad in (0.0, 2.0):
        turn = Rotation.from_euler("Z", yaw_rad)
        attitude = np.tile(turn.as_quat()[[3, 0, 1, 2]], (len(trace.time_s), 1))
        position = turn.apply(trace.base_position) + 7.0
        score = score_mission(finished, replace(trace, base_quaternion=attitude, base_position=position))
        assert score.final_error_m == pytest.approx(0.2, abs=1e-6)
        assert (score.done, score.arrived) == (True, False)
    assert score_mission(finished, walk(2.06)).arrived
    assert not score_mission(finished, replace(walk(2.06), fell=True)).done


def test_figures_count_missions_and_errors_are_of_complete_missions() -> None:
    scores = [MissionScore(True, "", 10.0, 0.02), MissionScore(True, "", 20.0, 0.3)]
    figures = mission_figures([*scores, MissionScore(False, "it is blocked", 40.0, 2.0)])
    assert (figures["missions_done"], figures["missions_arrived"]) == (2, 1)
    assert (figures["final_error_m"], figures["mission_s"]) == (0.3, 15.0)


def test_a_missions_file_is_a_scenario(tmp_path: Path) -> None:
    path = tmp_path / "home.yaml"
    path.write_text("steps: [{wait: 0.1}, {turn: 90}]")
    options = EvaluationOptions(scenarios=("nominal", str(path)), require=("home.missions_done >= 1",))
    (requirement,) = requirements_of(options)
    assert requirement.scenarios == ("home",)
    with pytest.raises(UserError, match=r"'home': step 2 \(turn\)"):
        evaluate_policy("stand", evaluation_config(options), console=Console(quiet=True))


def test_impossible_requests_are_refused_before_anything_runs() -> None:
    config = EvaluationConfig(scenarios=("rectangle",), mission_run=mission_run)
    with pytest.raises(UserError, match=r"'rectangle': step 1 \(rectangle\)"):
        evaluate_policy("stand", config, console=Console(quiet=True))
    with pytest.raises(UserError):
        evaluate_policy("go1-flat", replace(config, mission_run=None), console=Console(quiet=True))
    with pytest.raises(ValueError, match="mission"):
        Scenario("", 1, 1.0, DrawnCommands((0, 1), (0, 1), (0, 1), (1, 2)), mission={"steps": ["lie_down"]})
