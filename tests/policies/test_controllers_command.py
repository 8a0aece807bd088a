"""The velocity command is limited in acceleration; a small command means to stand."""

import numpy as np

from footfall.policies.controllers.command import CommandShaping, ShapedCommand

SHAPING = CommandShaping(acceleration_m_s2=2.0, yaw_acceleration_rad_s2=5.0, standing_command=0.1)


def test_each_axis_has_its_own_acceleration_in_both_directions() -> None:
    shaped = ShapedCommand(SHAPING)
    goal = np.array([0.5, -0.9, 0.03])
    found = []
    for _ in range(3):
        shaped.advance(goal, 0.1)
        found.append(shaped.value.tolist())
    np.testing.assert_allclose(found, [[0.2, -0.2, 0.03], [0.4, -0.4, 0.03], [0.5, -0.6, 0.03]])
    kept = shaped.value
    shaped.advance(np.array([0.0, 0.0, -2.0]), 0.1)
    np.testing.assert_allclose(shaped.value, [0.3, -0.4, -0.47])
    np.testing.assert_allclose(kept, found[-1])


def test_small_commands_of_all_axes_together_mean_stand() -> None:
    for command, walks in (
        *(((0.06, 0.06, 0.06), True), ((0.05, 0.05, 0.05), False), ((0, 0, -0.2), True), ((0, 0, 0), False)),
        *(((0.1, 0.0, 0.0), False), ((0.0, -0.1, 0.0), False), ((0.0, 0.0, 0.1), False)),
    ):
        shaped = ShapedCommand(SHAPING)
        assert shaped.requests_walk(np.array(command)) is walks
        shaped.advance(np.array(command), 0.5)
        assert shaped.value.any() == walks


def test_a_robot_walks_until_it_has_slowed_down_and_a_reset_stands() -> None:
    shaped = ShapedCommand(SHAPING)
    shaped.advance(np.array([0.0, 0.5, 0.0]), 0.1)
    still = np.zeros(3)
    assert shaped.requests_walk(still)
    shaped.advance(np.array([0.05, 0.0, 0.0]), 0.1)
    assert not shaped.value.any()
    assert not shaped.requests_walk(still)
    shaped.advance(np.array([0.0, 0.0, -2.0]), 0.1)  # turning on the spot is walking, too
    assert shaped.requests_walk(still)
    shaped.advance(np.array([1.0, 1.0, 1.0]), 0.1)
    shaped.reset()
    assert not shaped.requests_walk(still)
