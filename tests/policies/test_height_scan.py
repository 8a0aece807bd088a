"""The height scan: its points and the values that a policy observes."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footfall.common.errors import UserError
from footfall.policies.contract import Contract, Term
from footfall.policies.height_scan import HeightScan, common_height_scan
from footfall.policies.observation import Inputs, step_values, term_kind, term_size

SCAN = HeightScan(forward_m=(-0.2, 0.4), leftward_m=0.2, spacing_m=0.1)
SETTINGS = {"forward_m": [-0.2, 0.4], "leftward_m": 0.2, "spacing_m": 0.1}


@pytest.fixture
def seeing(contract: Contract) -> Contract:
    return replace(contract, observation=(Term("height_scan", 2.0, settings=SETTINGS),))


def seen(contract: Contract, heights: np.ndarray | None) -> np.ndarray:
    return step_values(Inputs({}, np.zeros(12), np.zeros(3), np.zeros(1), heights), contract)


def test_points_lie_from_back_to_front_and_from_right_to_left() -> None:
    assert SCAN.size == len(SCAN.points) == 7 * 5
    np.testing.assert_allclose(
        SCAN.points[[0, 1, 5, -1]], [[-0.2, -0.2], [-0.2, -0.1], [-0.1, -0.2], [0.4, 0.2]]
    )


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.1, 3.1))
def test_positions_rotate_with_the_heading(x: float, y: float, yaw: float) -> None:
    points = SCAN.positions(np.array([x, y, 0.3]), np.float64(yaw))
    ahead = points[-3] - points[-8]  # the middle of the first row minus that of the second
    np.testing.assert_allclose(ahead, 0.1 * np.array([np.cos(yaw), np.sin(yaw)]), atol=1e-9)
    leftward = points[-1] - points[-2]
    np.testing.assert_allclose(leftward, 0.1 * np.array([-np.sin(yaw), np.cos(yaw)]), atol=1e-9)


def test_a_policy_observes_scaled_clipped_heights_and_the_presence_of_a_scan(seeing: Contract) -> None:
    heights = np.linspace(-0.6, 0.2, SCAN.size)
    numbers = seen(seeing, heights)
    assert len(numbers) == term_size(seeing.observation[0], seeing) == SCAN.size + 1
    np.testing.assert_allclose(numbers, [*(2.0 * heights), 2.0])
    clipped = seen(seeing, np.where(np.arange(SCAN.size) < 3, -7.0, 3.0))
    np.testing.assert_allclose(clipped[[0, -2]], [-2.0, 1.0])
    heights[2:] = np.nan  # unknown points take the mean of the others
    np.testing.assert_allclose(seen(seeing, heights)[2:-1], 2.0 * heights[:2].mean())


@pytest.mark.parametrize("nothing", [None, np.full(SCAN.size, np.nan)])
def test_a_lost_scan_is_observed_as_zeros(seeing: Contract, nothing: np.ndarray | None) -> None:
    numbers = seen(seeing, nothing)
    assert len(numbers) == SCAN.size + 1
    assert not numbers.any()


def test_numpy_and_jax_agree(seeing: Contract) -> None:
    heights = np.random.default_rng(0).normal(size=(4, SCAN.size)).astype(np.float32)
    heights[1, :9] = np.nan
    in_numpy = step_values(Inputs({}, *np.zeros((3, 4, 3), np.float32), heights), seeing)
    in_jax = step_values(Inputs({}, *jnp.zeros((3, 4, 3)), jnp.asarray(heights)), seeing)
    assert in_numpy.dtype == np.float32
    np.testing.assert_allclose(in_numpy, in_jax, rtol=1e-5)


def test_mirrored_ground_gives_the_mirrored_observation(seeing: Contract) -> None:
    def ground(points: np.ndarray) -> np.ndarray:
        return 0.1 * points[:, 0] + 0.3 * points[:, 1] + points[:, 1] ** 3

    mirror = term_kind(seeing.observation[0]).mirror(None)  # type: ignore[arg-type]
    plain, other = (seen(seeing, ground(SCAN.points * [1.0, side])) for side in (1.0, -1.0))
    np.testing.assert_allclose(mirror(plain), other)


def test_an_invalid_scan_setting_is_refused_by_name(seeing: Contract) -> None:
    wrong: dict[str, object]
    for wrong in (
        {"spacing_m": 0.0},
        {"forward_m": [0.5, -0.5]},
        {"clip_m": [0.5, float("nan")]},
        {"spacing_m": 0.01, "forward_m": [-2.0, 2.0]},
        {"max_age_s": 0.01},
        {"width_m": 1.0},
    ):
        with pytest.raises(UserError, match="height_scan|" + next(iter(wrong))):
            term_size(Term("height_scan", settings=SETTINGS | wrong), seeing)


def test_policies_of_one_run_must_agree_on_the_scan(contract: Contract, seeing: Contract) -> None:
    assert common_height_scan([None, contract]) is None
    assert common_height_scan([contract, seeing, seeing]) == SCAN
    other = replace(seeing, observation=(Term("height_scan", settings={"spacing_m": 0.2}),))
    with pytest.raises(UserError):
        common_height_scan([seeing, other])
