"""Inverse kinematics in closed form, limb by limb, against a chain of scipy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.robots.closed_form import closed_form
from footfall.robots.limb import Limb

SLANTING = (0.8, 0.36, 0.48)  # a first hinge neither across the parallel ones nor along them


def limb(default_knee: float = -1.1, first: tuple[float, ...] = SLANTING) -> Limb:
    """Links that are bent at zero and have sideways offsets; all figures differ."""
    return Limb(
        anchor=np.array([[0.2, 0.1, 0.05], [0.25, 0.16, 0.03], [0.27, 0.18, -0.17]]),
        axis=np.array([first, [0.0, 1.0, 0.0], [0.0, 1.0, 0.0]]),
        tip=np.array([0.22, 0.215, -0.36]),
        lower=np.array([-0.9, -1.2, -2.4]),
        upper=np.array([0.7, 1.4, 2.2]),
        default=np.array([0.1, 0.4, default_knee]),
    )


def tip_at(chain: Limb, angles: np.ndarray) -> np.ndarray:
    """Position of the tip: each hinge, the last one first, rotates everything after it."""
    position = chain.tip
    for anchor, axis, angle in zip(chain.anchor[::-1], chain.axis[::-1], angles[::-1], strict=True):
        position = anchor + Rotation.from_rotvec(angle * axis).apply(position - anchor)
    return position


@pytest.mark.parametrize("first", [SLANTING, (-0.8, 0.36, -0.48), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)])
@pytest.mark.parametrize("knee", [-1.1, 0.5, 0.9])
@pytest.mark.parametrize("moved", [(0.0, 0.0, 0.0), (-0.1, 0.3, -0.2), (0.25, -0.4, 0.3)])
def test_a_position_gives_the_angles_that_reach_it(
    first: tuple[float, ...], knee: float, moved: tuple[float, ...]
) -> None:
    chain = limb(knee, first)
    form = closed_form(chain, tip_at(chain, chain.default))
    assert form is not None
    angles = chain.default + moved
    np.testing.assert_allclose(form.angles(tip_at(chain, angles).tolist()), angles, atol=1e-9)


def test_limbs_of_another_kind_have_no_closed_form() -> None:
    for change in (
        {"axis": np.array([SLANTING, [0, 1, 0], [0, 0.9999875, 0.005]])},  # 0.3 degrees askew
        {"axis": np.array([SLANTING, [0, 1, 0], [0, -1, 0]])},
        {"axis": np.array([[0, 1, 0], [0, 1, 0], [0, 1, 0]])},  # all three parallel
        {"anchor": np.array([[0.2, 0.1, 0.05], [0.25, 0.16, 0.03], [0.25, 0.3, 0.0301]])},  # no thigh
        {"tip": np.array([0.2701, 0.3, -0.17])},  # no shank
        {"anchor": np.zeros((2, 3)), "axis": np.array([[1, 0, 0], [0, 1, 0]])},
        {"anchor": np.zeros((4, 3)), "axis": np.array([[1, 0, 0], [0, 1, 0], [0, 1, 0], [0, 1, 0]])},
    ):
        assert closed_form(limb()._replace(**change), limb().tip) is None
