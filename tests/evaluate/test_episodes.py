"""One episode as a worker runs it: the parts of its plan that reach the simulated robot, and its scores."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from footfall.domain_rand.noise import Noise
from footfall.evaluate.episodes import EpisodeOutcome, EpisodeTask, run_task
from footfall.evaluate.plan import CommandSchedule, EpisodePlan
from footfall.terrain.declaration import GroundConfig

GRAVITY = 9.81
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


def test_noise_reaches_the_readings_that_a_policy_acts_on() -> None:
    still, noisy = run("go1-flat"), run("go1-flat", replace(QUIET, gyro=0.2))
    assert np.abs(targets(still) - targets(noisy)).max() > 1e-3
    other_seed = run("go1-flat", replace(QUIET, gyro=0.2), seed=6)
    assert not np.array_equal(targets(noisy), targets(other_seed))


def test_an_episode_does_not_depend_on_the_previous_episode_of_its_process() -> None:
    first = run("go1-flat")
    run("go1-flat", schedule=CommandSchedule((0.0,), ((-0.5, 0.3, 0.8),)))
    assert np.array_equal(targets(first), targets(run("go1-flat")))


def test_a_policy_gets_the_true_velocity_only_on_request() -> None:
    task = EpisodeTask("mpc", "go1", replace(PLAN, duration_s=0.2), QUIET, keep_trace=True)
    estimating, knowing = (run_task(replace(task, ground_truth=truth)).trace for truth in (False, True))
    assert estimating is not None
    assert knowing is not None
    assert np.array_equal(knowing.estimated_velocity, knowing.base_velocity)
    assert not np.allclose(estimating.estimated_velocity, estimating.base_velocity, atol=1e-3)


def test_cost_of_transport_uses_the_weight_of_robot_and_load() -> None:
    bare, loaded = (
        run("stand", levels={"payload_kg": load}, duration_s=0.1).metrics.weight_n for load in (0.0, 3.0)
    )
    assert bare / GRAVITY == pytest.approx(12.0, abs=1.5)  # published: 12 kg with battery
    assert loaded - bare == pytest.approx(3.0 * GRAVITY, rel=1e-6)


def test_a_robot_walks_down_the_stairs_of_its_episode() -> None:
    stairs = GroundConfig("stairs", settings={"step_m": -0.03, "tread_m": 0.3, "start_m": 0.3})
    outcome = run("trot", duration_s=2.0, ground=stairs)
    assert outcome.trace is not None
    assert outcome.trouble == ""
    lowest = outcome.trace.foot_position[..., 2].min(axis=1)
    assert lowest[0] - lowest[-1] > 0.025
    assert 0.4 < outcome.metrics.progress < 1.1
