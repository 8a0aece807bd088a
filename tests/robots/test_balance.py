"""Centre of mass, capture point, support polygon and ground forces against a simulation's truth."""

import numpy as np
import pytest

from footfall.deploy.loop import ControlLoop
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.balance import Balance, BalanceModel
from footfall.robots.description import load_robot

RIGHT = np.array([0.0, -0.4, 0.0])  # m/s, of the base


@pytest.mark.parametrize(("name", "corners"), [("go1", 4), ("g1", 6)])
def test_balance_of_a_standing_robot(name: str, corners: int) -> None:
    robot = load_robot(name)
    model, seen = BalanceModel(load_robot(name)), []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.walking and not seen:
            truth = body.truth()
            pose = truth.base_position, truth.base_quaternion
            for velocity, contact in (
                (np.zeros(3), truth.foot_contact),
                (RIGHT, np.zeros(len(truth.foot_contact))),
            ):
                seen.append(model.at(*pose, velocity, loop.sensed, contact))
            seen.append((truth, body.data.subtree_com[1].copy()))

    run_episode(robot, load_policy("stand", robot), Episode(lambda _: np.zeros(3), 0.1), watch)
    still: Balance
    still, moved, (truth, centre) = seen
    np.testing.assert_allclose(still.centre, centre, atol=1e-3)
    np.testing.assert_allclose(still.capture[:2], centre[:2], atol=0.02)
    np.testing.assert_allclose(still.foot[:, 2], 0.0, atol=0.01)
    assert still.force[:, 2].sum() == pytest.approx(truth.foot_force.sum(), rel=0.15)
    assert len(still.support) == corners
    fall_s = np.sqrt(centre[2] / 9.81)
    np.testing.assert_allclose(moved.capture[:2] - still.capture[:2], [0.0, -0.4 * fall_s], atol=0.01)
    assert (len(moved.support), np.abs(moved.force).max()) == (0, 0.0)
