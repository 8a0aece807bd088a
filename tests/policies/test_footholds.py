"""Planned footholds against the positions where feet land."""

import numpy as np
import pytest

from footfall.common.rotations import heading_matrix, yaw_of
from footfall.deploy.loop import ControlLoop
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.policy import PlansFootholds
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot


@pytest.mark.parametrize(("name", "policy", "duration_s"), [("go1", "trot", 1.1), ("g1", "step", 2.0)])
def test_feet_land_where_they_are_planned_to(name: str, policy: str, duration_s: float) -> None:
    robot = load_robot(name)
    walker = load_policy(policy, robot)
    assert isinstance(walker, PlansFootholds)
    planned = np.full((len(robot.description.feet), 3), np.nan)  # world frame
    missed: list[np.ndarray] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if not loop.walking or loop.walking_s < 0.7:
            return
        truth, before = body.truth(), planned.copy()
        turn = heading_matrix(yaw_of(truth.base_quaternion.tolist()))
        planned[:] = truth.base_position + walker.footholds() @ turn.T
        landed = np.isnan(planned[:, 0]) & ~np.isnan(before[:, 0])
        missed.extend((truth.foot_position - before)[landed])

    run_episode(robot, walker, Episode(lambda _: np.array([0.3, 0.0, 0.2]), duration_s), watch)
    assert len(missed) >= 2
    assert np.abs(missed).max(axis=0) == pytest.approx(np.zeros(3), abs=0.035)  # the foot's thickness
