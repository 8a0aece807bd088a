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


@pytest.mark.parametrize("knee", [-0.55, -0.15, 0.15, 0.55])
def test_the_knee_bends_as_in_the_default_pose_counted_from_links_in_a_line(knee: float) -> None:
    """The links are in a line at -0.357 rad.

    Their directions are (0.02, -0.2) and (-0.05, -0.19); the angle is atan(0.1) + atan(5/19).
    """
    for sign in (1.0, -1.0):  # hinges with the opposite sign
        chain = limb(sign * knee)
        chain = chain._replace(axis=chain.axis * [[1.0], [sign], [sign]])
        chain = chain._replace(default=chain.default * [1.0, sign, 1.0])
        form = closed_form(chain, tip_at(chain, chain.default))
        assert form is not None
        found = form.angles(tip_at(chain, chain.default).tolist())
        np.testing.assert_allclose(found, chain.default, atol=1e-9)


def test_a_limb_stretches_towards_a_position_out_of_reach_within_the_limits() -> None:
    chain = limb(first=(1.0, 0.0, 0.0))
    form = closed_form(chain, tip_at(chain, chain.default))
    assert form is not None
    first, second, third = form.angles([0.3, 0.3, -3.0])
    hip = chain.anchor[0] + Rotation.from_rotvec([first, 0, 0]).apply(chain.anchor[1] - chain.anchor[0])
    reached = tip_at(chain, np.array([first, second, third]))
    aim, arm = np.array([0.3, 0.3, -3.0]) - hip, reached - hip
    assert arm @ aim / np.linalg.norm(arm) / np.linalg.norm(aim) > 0.99
    longest = np.hypot(0.02, 0.2) + np.hypot(0.05, 0.19)
    assert np.linalg.norm(arm[[0, 2]]) == pytest.approx(longest, abs=1e-2)
    # The knee cannot bend far enough: the foot is on the line to the position, too far
    # out.
    position = tip_at(chain, np.array([0.1, 0.4, -2.0]))
    stiff = form._replace(middle=[0.0, 0.0, 0.0], half=[1.0, 1.5, 1.5]).angles(position.tolist())
    assert stiff[2] == pytest.approx(-1.5)
    turn = Rotation.from_rotvec([stiff[0], 0, 0])
    hip = chain.anchor[0] + turn.apply(chain.anchor[1] - chain.anchor[0])
    aim, arm = (turn.inv().apply(end - hip)[[0, 2]] for end in (position, tip_at(chain, np.array(stiff))))
    assert arm @ aim == pytest.approx(np.linalg.norm(arm) * np.linalg.norm(aim), rel=1e-6)
    folded = np.array(form.angles((chain.anchor[1] + [0.0, 0.055, 0.0]).tolist()))
    assert np.all((chain.lower <= folded) & (folded <= chain.upper))


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
