"""The hexapod's gaits over the simulated bus, a few steps each."""

import numpy as np
import pytest

from footfall.common.rotations import heading
from footfall.plant.episode import Episode, run_episode
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

ROBOT = load_robot("hexapod")


@pytest.mark.parametrize(("gait", "least_m"), [("tripod", 0.14), ("ripple", 0.13), ("wave", 0.05)])
def test_it_walks_straight_without_sinking_or_a_joint_beyond_its_limit(gait: str, least_m: float) -> None:
    policy = load_policy(gait, ROBOT)
    trace = run_episode(ROBOT, policy, Episode(lambda _: np.array([0.12, 0.0, 0.0]), 3.0))
    walked = trace.base_position[-1] - trace.base_position[0]
    assert not trace.fell
    assert trace.faults == ()
    assert walked[0] > least_m
    assert abs(walked[1]) < 0.05 * walked[0] + 0.01  # the body sways by a centimetre within a cycle
    assert abs(float(heading(trace.base_quaternion[-1]))) < 0.05
    assert trace.base_position[:, 2].min() > 0.18
    assert np.abs(trace.joint_velocity).max() < 3.6  # targets move at 3.0 at most; the motors' PD lags behind
    assert [note.split(":")[0] for note in trace.notes] == [gait]


def test_the_fast_contender_is_twice_as_fast_as_the_given_steps() -> None:
    """These walk 0.094 m/s at most, by the generator's own check."""
    policy = load_policy(f"tripod@{ROBOT.folder / 'fast.yaml'}", ROBOT)
    trace = run_episode(ROBOT, policy, Episode(lambda _: np.array([0.25, 0.0, 0.0]), 3.0))
    assert not trace.fell
    assert trace.faults == ()
    late = trace.time_s > 2.0
    assert trace.base_velocity[late, 0].mean() > 0.19
    assert abs(trace.base_velocity[late, 1].mean()) < 0.02
    assert trace.base_position[:, 2].min() > 0.18
