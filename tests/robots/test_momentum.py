"""The momentum observer, on one limb of one joint: 2 kg m^2, a filter of 10 ms, readings every 2 ms."""

import numpy as np

from footfall.robots.momentum import MomentumObserver, upward_force

INERTIA = np.array([[[2.0]]])
FILTER_S, DT_S = 0.01, 0.002


def after(ticks: int, outside: float = 0.0, acceleration: float = 0.0) -> list[float]:
    """Filtered outside torque and rate of change of the momentum, N m, after constant readings."""
    observer = MomentumObserver(INERTIA, FILTER_S)
    observer.reset(np.zeros((1, 1)), np.zeros((1, 1)))
    for tick in range(1, ticks + 1):
        rates = np.array([[acceleration * tick * DT_S]])
        found = observer.update(np.array([[outside]]), rates, DT_S)
    return found[0, 0].tolist()


def test_a_constant_velocity_has_no_acceleration() -> None:
    observer = MomentumObserver(INERTIA, FILTER_S)
    observer.reset(np.zeros((1, 1)), np.array([[7.0]]))
    assert observer.update(np.zeros((1, 1)), np.array([[7.0]]), DT_S).tolist() == [[[0.0, 0.0]]]


def test_the_upward_part_of_the_force_at_the_foot() -> None:
    """Three sliding joints along x, y and z; the vertical is tilted by 3 : 4 in the plane of y and z."""
    torque = np.array([[[1.0, 10.0], [2.0, 20.0], [3.0, 30.0]]])
    up = np.array([0.0, 0.6, 0.8])
    force = upward_force(np.eye(3)[None], torque, up)
    np.testing.assert_allclose(force, [[3.6, 36.0]], rtol=2e-5)
    flat = np.diag([1.0, 1.0, 0.0])[
        None
    ]  # joints slide horizontally only: no torque depends on the vertical force
    assert upward_force(flat, np.ones((1, 3, 1)), np.array([0.0, 0.0, 1.0])).tolist() == [[0.0]]
