"""Centre of mass, capture point, support polygon, and forces at the feet."""

import math

import numpy as np
import pytest
from deploy_policies import short_episode

from footfall import load_policy, load_robot, run_episode
from footfall.deploy.loop import ControlLoop
from footfall.plant.robot import SimulatedRobot
from footfall.robots.balance import BalanceModel
from footfall.robots.momentum import MomentumObserver, upward_force
from footfall.robots.support import support_margin


@pytest.mark.parametrize(("name", "corners"), [("go1", 4), ("g1", 6)])
def test_balance_of_a_standing_robot(name: str, corners: int) -> None:
    """The balance is compared with the simulation's truth, also for a base that moves to the right."""
    robot = load_robot(name)
    model, seen = BalanceModel(robot), []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.walking and not seen:
            truth = body.truth()
            pose = truth.base_position, truth.base_quaternion
            seen.append(model.at(*pose, np.zeros(3), loop.sensed, truth.foot_contact))
            right = np.array([0.0, -0.4, 0.0])  # m/s
            seen.append(model.at(*pose, right, loop.sensed, np.zeros(len(truth.foot_contact))))
            seen.append((truth, body.data.subtree_com[1].copy()))

    run_episode(robot, load_policy("stand", robot), short_episode(duration_s=0.1), watch)
    still, moved, (truth, centre) = seen
    np.testing.assert_allclose(still.centre, centre, atol=1e-3)
    np.testing.assert_allclose(still.capture[:2], centre[:2], atol=0.02)
    np.testing.assert_allclose(still.foot[:, 2], 0.0, atol=0.01)
    assert still.force[:, 2].sum() == pytest.approx(truth.foot_force.sum(), rel=0.15)
    assert len(still.support) == corners
    fall_s = np.sqrt(centre[2] / 9.81)
    np.testing.assert_allclose(moved.capture[:2] - still.capture[:2], [0.0, -0.4 * fall_s], atol=0.01)
    assert (len(moved.support), np.abs(moved.force).max()) == (0, 0.0)


def test_the_static_margin_is_the_distance_to_the_nearest_edge() -> None:
    triangle = [(0.0, 0.0), (4.0, 0.0), (0.0, 3.0)]  # sides 4, 3, 5
    inner = [(1.0, 1.0), *triangle, (2.0, 0.0), (0.3, 0.4)]
    line = [(0.0, 0.0), (1.0, 1.0), (3.0, 3.0)]
    for feet, point, margin in (
        (triangle, (1.0, 1.0), 1.0),  # the centre of the inscribed circle
        (triangle, (0.5, 1.0), 0.5),
        (triangle, (2.0, 0.1), 0.1),
        (triangle, (2.0, -0.5), -0.5),
        (triangle, (4.0 + 0.8, 3.0 + 0.6), -(4.8 * 3 + 3.6 * 4 - 12) / 5),
        (triangle, (-3.0, -4.0), -5.0),  # nearest to a corner, not to the line of an edge
        (inner, (0.5, 1.0), 0.5),
        ([], (0.0, 0.0), -math.inf),
        ([(3.0, 4.0)], (0.0, 0.0), -5.0),
        ([(-1.0, 2.0), (3.0, 2.0)], (0.5, 0.0), -2.0),
        (line, (1.0, 0.0), -math.sqrt(0.5)),
        (line, (2.0, 2.0), 0.0),
        (line, (5.0, 5.0), -math.sqrt(8.0)),
    ):
        for order in (feet, feet[::-1]):
            assert support_margin(order, point) == pytest.approx(margin)


def test_a_constant_velocity_has_no_acceleration() -> None:
    observer = MomentumObserver(np.array([[[2.0]]]), filter_s=0.01)
    observer.reset(np.zeros((1, 1)), np.array([[7.0]]))
    assert observer.update(np.zeros((1, 1)), np.array([[7.0]]), 0.002).tolist() == [[[0.0, 0.0]]]


def test_the_upward_part_of_the_force_at_the_foot() -> None:
    """Three sliding joints along x, y and z; the vertical is tilted by 3 : 4 in the plane of y and z."""
    torque = np.array([[[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]]])
    force = upward_force(np.eye(3)[None], torque, np.array([0.0, 0.6, 0.8]))
    np.testing.assert_allclose(force, [[3.6, 36.0]], rtol=2e-5)
    flat = np.diag([1.0, 1.0, 0.0])[None]  # horizontal joints: no torque depends on the vertical force
    assert upward_force(flat, np.ones((1, 3, 1)), np.array([0.0, 0.0, 1.0])).tolist() == [[0.0]]
