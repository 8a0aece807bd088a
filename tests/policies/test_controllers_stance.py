"""Where the hand-written controllers put the feet."""

from types import SimpleNamespace

import numpy as np

from footfall.policies.controllers.stance import level_feet, nominal_feet


def test_each_foot_stands_out_from_its_own_place() -> None:
    """A hexapod's middle feet stand wider than its outer ones, and a foot in the middle plane stays there."""
    feet = np.array([[0.3, 0.1, -0.2], [0.0, -0.25, -0.2], [-0.3, 1e-12, -0.2]])
    legs = SimpleNamespace(default_foot=feet, foot_radius=np.array([0.02, 0.02, 0.03]))
    stance = nominal_feet(legs, height_m=0.3, outward_m=0.05, shift_m=0.01)  # type: ignore[arg-type]
    np.testing.assert_allclose(
        stance, [[0.31, 0.15, -0.28], [0.01, -0.3, -0.28], [-0.29, 0.0, -0.27]], atol=1e-9
    )


def test_legs_push_down_on_the_side_that_has_sunk() -> None:
    """Rolled to the right (positive roll), the right feet reach lower; pitched nose-down, the front ones."""
    feet = np.array([[0.2, -0.1, -0.3], [-0.2, 0.1, -0.3]])  # front right, rear left
    np.testing.assert_allclose(level_feet(feet, np.array([0.1, 0.0]))[:, 2], [-0.31, -0.29])
    np.testing.assert_allclose(level_feet(feet, np.array([0.0, 0.1]))[:, 2], [-0.32, -0.28])
