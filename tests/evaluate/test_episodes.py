"""One episode as a worker runs it: the parts of its plan that reach the simulated robot, and its scores."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from scipy.spatial.transform import Rotation
from traces import walk

from footfall import EvaluationConfig, UserError, evaluate_policy
from footfall.deploy.command_source import Pose
from footfall.domain_rand.noise import Noise
from footfall.evaluate.episodes import EpisodeOutcome, EpisodeTask, run_task
from footfall.evaluate.missions import MissionScore, mission_figures, score_mission
from footfall.evaluate.plan import CommandSchedule, EpisodePlan, plan_episodes
from footfall.evaluate.scenarios import DrawnCommands, Scenario
from footfall.evaluation_options import EvaluationOptions, evaluation_config, requirements_of
from footfall.operate.missions.run import mission_run
from footfall.operate.missions.source import DONE, Progress
from footfall.terrain.declaration import GroundConfig

pytestmark = pytest.mark.usefixtures("quick_standing")

QUIET = Noise(joint_position=0.0, joint_velocity=0.0, gyro=0.0, gravity=0.0)
PLAN = EpisodePlan(
    scenario="own", index=0, seed=5, duration_s=0.5, schedule=CommandSchedule((0.0,), ((0.5, 0.0, 0.0),)),
    pushes=(), levels={}, randomised=False,
)  # fmt: skip


def run(policy: str, noise: Noise = QUIET, **changes: Any) -> EpisodeOutcome:
    return run_task(EpisodeTask(policy, "go1", replace(PLAN, **changes), noise, keep_trace=True))


def targets(outcome: EpisodeOutcome) -> np.ndarray:
    assert outcome.trace is not None
    return outcome.trace.joint_target


def test_noise_reaches_the_policy_and_no_episode_depends_on_the_previous_one() -> None:
    still, noisy = run("go1-flat"), run("go1-flat", replace(QUIET, gyro=0.2))
    assert np.abs(targets(still) - targets(noisy)).max() > 1e-3
    assert not np.array_equal(targets(noisy), targets(run("go1-flat", replace(QUIET, gyro=0.2), seed=6)))
    run("go1-flat", schedule=CommandSchedule((0.0,), ((-0.5, 0.3, 0.8),)))
    assert np.array_equal(targets(still), targets(run("go1-flat")))


def test_a_policy_gets_the_true_velocity_only_on_request() -> None:
    task = EpisodeTask("mpc", "go1", replace(PLAN, duration_s=0.2), QUIET, keep_trace=True)
    estimating, knowing = (run_task(replace(task, ground_truth=truth)).trace for truth in (False, True))
    assert estimating is not None
    assert knowing is not None
    np.testing.assert_allclose(knowing.estimated_velocity, knowing.base_velocity, atol=1e-12)
    assert not np.allclose(estimating.estimated_velocity, estimating.base_velocity, atol=1e-3)


def test_cost_of_transport_uses_the_weight_of_robot_and_load() -> None:
    bare, loaded = (
        run("stand", levels={"payload_kg": load}, duration_s=0.1).metrics.weight_n for load in (0.0, 3.0)
    )
    assert bare / 9.81 == pytest.approx(12.0, abs=1.5)  # published: 12 kg with battery
    assert loaded - bare == pytest.approx(3.0 * 9.81, rel=1e-6)


def test_a_robot_walks_down_the_stairs_of_its_episode() -> None:
    stairs = GroundConfig("stairs", settings={"step_m": -0.03, "tread_m": 0.3, "start_m": 0.3})
    outcome = run("trot", duration_s=2.0, ground=stairs)
    assert outcome.trace is not None
    assert outcome.trouble == ""
    lowest = outcome.trace.foot_position[..., 2].min(axis=1)
    assert lowest[0] - lowest[-1] > 0.025
    assert 0.4 < outcome.metrics.progress < 1.1


def errand(steps: list[Any], duration_s: float = 20.0) -> tuple[EpisodeOutcome, MissionScore]:
    """A mission of these steps as an episode, and its score."""
    (plan,) = plan_episodes("errand", Scenario("", 1, duration_s, mission={"steps": steps}), seed=3)
    outcome = run_task(EpisodeTask("go1-flat", "go1", plan, QUIET, mission_run=mission_run))
    assert outcome.mission is not None
    return outcome, outcome.mission


def test_a_mission_steers_and_its_result_is_scored() -> None:
    outcome, mission = errand([{"go_to": [0.3, 0.0]}, {"policy": "stand"}, {"wait": 0.1}])
    assert (mission.done, mission.arrived, outcome.trouble) == (True, True, "")
    assert 0.5 < mission.lasted_s < 10.0
    assert outcome.metrics.distance_m > 0.2
    slow = {"go_to": {"to": [0.4, 0.0], "timeout_s": 0.3}}
    unfinished = (
        (slow, 20.0, "step 1 (go_to): it takes longer than 0 s"),
        ({"wait": 20.0}, 0.3, "not over in time"),
    )
    for step, duration_s, why in unfinished:
        outcome, mission = errand([step], duration_s)
        assert (mission.done, outcome.metrics.fell) == (False, False)
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
