"""Grounds: equal heights in NumPy, JAX and MuJoCo; shapes, files, refusals."""

from pathlib import Path

import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from PIL import Image
from refused import refusal_of

from footfall.plant.ground import replace_ground
from footfall.terrain.declaration import load_ground, named_grounds
from footfall.terrain.ground import Ground, edge_at, height_at, tangent_at


def in_mujoco(ground: Ground, positions: np.ndarray) -> np.ndarray:
    """Heights (n,) at positions (n, 2), by rays from above on the geoms of a plant."""
    spec = mujoco.MjSpec()
    replace_ground(spec, ground)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    hit, down = np.zeros(1, dtype=np.int32), np.array([0.0, 0.0, -1.0])
    above = np.insert(positions, 2, 5.0, axis=1)
    return np.array([5.0 - mujoco.mj_ray(model, data, point, down, None, 1, -1, hit) for point in above])


@pytest.mark.parametrize("name", named_grounds())
def test_numpy_jax_and_mujoco_agree_on_a_ground(name: str) -> None:
    ground = load_ground(name, seed=3)
    positions = np.random.default_rng(1).uniform(-6.0, 6.0, (300, 2))
    heights = height_at(ground, positions)
    # MuJoCo divides the squares of a height field into triangles: between grid points heights differ.
    tolerance_m = 1e-5 if ground.stepped[0] else 0.01
    np.testing.assert_allclose(in_mujoco(ground, positions), heights, atol=tolerance_m)
    on_jax = ground._replace(heights=jnp.asarray(ground.heights), stepped=jnp.asarray(ground.stepped))
    difference = np.abs(np.asarray(height_at(on_jax, jnp.asarray(positions))) - heights)
    assert np.quantile(difference, 0.98) < 1e-5  # a position may fall into the next cell by rounding
    assert not height_at(ground, np.random.default_rng(1).uniform(-0.9, 0.9, (50, 2))).any()
    assert np.ptp(height_at(ground, np.array([[5.0, 0.0], [-5.0, 4.0], [0.0, -9.0], [2.0, 5.0]]))) < 1e-9


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_stairs_rise_by_their_step_at_the_same_distance_on_all_sides(side: float) -> None:
    ground = load_ground("stairs,step_m=0.1,tread_m=0.3,start_m=1.0")
    positions = side * np.array([0.99, 1.01, 1.29, 1.31])
    for axis in (0, 1):
        heights = height_at(ground, positions[:, None] * np.eye(2)[axis])
        np.testing.assert_allclose(heights, [0.0, 0.1, 0.1, 0.2], atol=1e-9)


def test_random_heights_follow_from_the_seed_and_fill_the_declared_range() -> None:
    one, same, other = (load_ground("blocks", seed=seed).heights for seed in (1, 1, 2))
    assert (one == same).all()
    assert (one != other).any()
    for spec, low, high in (
        ("waves,wave_m=0.2", -0.1, 0.1),
        ("rough,roughness_m=0.05", -0.05, 0.05),
        ("blocks,block_m=0.1", 0.0, 0.1),
    ):
        heights = load_ground(spec, seed=1).heights
        np.testing.assert_allclose([heights.min(), heights.max()], [low, high], atol=0.02 * (high - low))


def test_slopes_are_the_change_of_height() -> None:
    ground = load_ground("rough,roughness_m=0.05", seed=2)
    positions, step = np.random.default_rng(0).uniform(-4.0, 4.0, (200, 2)), 1e-6
    for axis in (0, 1):
        moved = positions + step * np.eye(2)[axis]
        numeric = (height_at(ground, moved) - height_at(ground, positions)) / step
        np.testing.assert_allclose(tangent_at(ground, positions).slope[:, axis], numeric, atol=1e-4)


@pytest.mark.parametrize("name", ["stairs", "blocks", "gaps"])
def test_an_edge_lies_between_two_levels(name: str) -> None:
    """On the two sides of an edge the heights are the two levels; elsewhere only one level is near."""
    ground = load_ground(name, seed=3)
    positions = np.random.default_rng(1).uniform(-4.5, 4.5, (400, 2))
    assert edge_at(load_ground("rough", seed=3), positions).high.max() <= -1.0  # rough ground has no edges
    edge, here = edge_at(ground, positions), height_at(ground, positions)
    near = edge.high > -1.0
    np.testing.assert_array_equal(edge.low[~near], here[~near])
    assert np.isclose(here, edge.low)[near].mean() > 0.2
    assert np.isclose(here, edge.high)[near].mean() > 0.2
    normal, offset = edge.normal[near], edge.offset[near]
    onto = positions[near] + (offset - (positions[near] * normal).sum(axis=1))[:, None] * normal
    assert np.linalg.norm(onto - positions[near], axis=1).max() <= 2 * ground.cell_m + 1e-9
    np.testing.assert_allclose(height_at(ground, onto + 1e-6 * normal), edge.low[near], atol=1e-9)
    np.testing.assert_allclose(height_at(ground, onto - 1e-6 * normal), edge.high[near], atol=1e-9)
    on_jax = Ground(jnp.asarray(ground.heights), jnp.asarray(ground.stepped), ground.cell_m)
    for numpy_values, jax_values in zip(edge, edge_at(on_jax, jnp.asarray(positions)), strict=True):
        # A position may be in the next cell.
        assert np.quantile(np.abs(numpy_values - np.asarray(jax_values)), 0.98) < 1e-4


def test_height_maps_lie_along_their_axes(tmp_path: Path) -> None:
    heights = np.zeros((8, 6))  # x, y
    heights[6, 1] = 0.2
    np.save(tmp_path / "map.npy", heights)
    picture = (heights.T[::-1].T[::-1] * 255).astype(np.uint8)  # x upwards, y to the left
    Image.fromarray(picture).save(tmp_path / "map.png")
    for name in ("map.npy", "map.png"):
        ground = load_ground(f"{tmp_path / name},cell_m=0.5")
        highest = np.argwhere(ground.heights[0] == ground.heights[0].max())[0]
        x, y = highest * 0.5 - ground.half_m
        assert x > 0.5 > -0.5 > y
        assert ground.heights.max() == pytest.approx(0.2, abs=0.01)


def test_a_malformed_ground_is_refused_in_one_line(tmp_path: Path) -> None:
    np.save(tmp_path / "flat.npy", np.zeros(4))
    np.save(tmp_path / "nan.npy", np.full((4, 4), np.nan))
    (tmp_path / "bad.png").write_text("no picture")
    files = {str(tmp_path / name): name for name in ("none.npy", "flat.npy", "nan.npy", "bad.png")}
    specs = {"stair": "stairs", "stairs,step_m=9": "step_m", "stairs,depth=1": "depth"}
    for spec, word in (specs | {"stairs,step_m": "KEY=NUMBER"} | files).items():
        assert word in refusal_of(load_ground, spec)
