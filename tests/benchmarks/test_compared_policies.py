"""Policies under comparison: paired walks, the hidden robot, two networks in one."""

import itertools
import json
import shutil
from pathlib import Path

import jax
import numpy as np
import pytest
from compared_policies import compare, figures, read
from identified_policies import with_nominal_losses
from side_by_side import side_by_side
from teacher_student import action_of, mean_action

from footfall.robots.description import Robot
from footfall.robots.model import read_plant
from footfall.train.origin import Exported


def _write(path: Path, scale: dict[str, float], energy: dict[str, float], fallen: dict[str, int]) -> Path:
    """Walks of two seeds; errors and energies are those of `wide` times a factor."""
    rng, rows = np.random.default_rng(0), []
    same = {"scenario": "nominal", "scored_s": 20.0, "weight_n": 100.0, "distance_m": 10.0}
    for seed in (0, 1):
        base = rng.uniform(0.5, 1.5, (2, 40))
        for condition, factor in scale.items():
            for index, (error, joules) in enumerate(base.T):
                row = {
                    "policy": f"{condition}-{seed}",
                    "index": index,
                    "fell": index < fallen.get(condition, 0),
                }
                errors = dict.fromkeys(("lin_vel_mse", "yaw_rate_mse"), error * factor**2)
                rows.append(same | row | errors | {"electrical_j": joules * energy[condition]})
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    return path


def test_a_paired_difference_does_not_contain_the_walks_own_spread(tmp_path: Path) -> None:
    same = {"wide": 1.0, "identified-1.3": 0.9}
    found = read(_write(tmp_path / "walks.jsonl", same, {"wide": 1.0, "identified-1.3": 0.97}, {}))
    difference = compare(found["identified-1.3"], found["wide"], draws=50)
    np.testing.assert_allclose(difference.relative, [-0.1, -0.1, -0.03], atol=1e-9)
    np.testing.assert_allclose(difference.interval, [difference.relative] * 2, atol=1e-9)
    assert difference.as_good == (True, True, True)


@pytest.mark.parametrize(
    ("tracking", "energy", "fallen", "verdict"),
    [
        (1.01, 1.0, 0, (False, True, True)),
        (1.0, 1.01, 0, (True, False, True)),
        (1.0, 1.004, 0, (True, True, True)),
        (0.9, 0.9, 1, (True, True, False)),
    ],
)
def test_a_worse_quantity_fails(
    tmp_path: Path, tracking: float, energy: float, fallen: int, verdict: tuple[bool, bool, bool]
) -> None:
    scale, energies = ({"wide": 1.0, "other": factor} for factor in (tracking, energy))
    found = read(_write(tmp_path / "walks.jsonl", scale, energies, {"other": fallen}))
    assert compare(found["other"], found["wide"], draws=50).as_good == verdict


def test_only_walks_that_all_policies_of_a_seed_have_count(tmp_path: Path) -> None:
    same = {"wide": 1.0, "other": 1.0}
    path = _write(tmp_path / "walks.jsonl", same, same, {})
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    kept = [row for row in rows if row["policy"] != "other-1" or row["index"] >= 10]
    path.write_text("".join(json.dumps(row) + "\n" for row in kept))
    found = read(path)
    assert {seed: len(walks) for seed, walks in found["wide"]["nominal"].items()} == {0: 40, 1: 30}
    np.testing.assert_array_equal(*(figures(found[name]["nominal"].values()) for name in ("wide", "other")))


def test_a_folders_damping_is_not_added_to_the_hidden_robots(go1: Robot, tmp_path: Path) -> None:
    folder = tmp_path / "identified"
    shutil.copytree(go1.folder, folder)
    model = folder / go1.description.model
    model.write_text(model.read_text().replace("<joint ", '<joint damping="0.1" '))
    found = read_plant(with_nominal_losses(str(folder)), go1.xml_path).motor
    np.testing.assert_array_equal(found.damping, go1.motor.damping)
    np.testing.assert_array_equal(found.friction, go1.motor.friction)


def network(rng: np.random.Generator, sizes: tuple[int, ...]) -> Exported:
    layers = tuple(
        (rng.normal(size=pair).astype(np.float32), rng.normal(size=pair[1]).astype(np.float32))
        for pair in itertools.pairwise(sizes)
    )
    return Exported(rng.normal(size=sizes[0]), rng.uniform(0.5, 2.0, sizes[0]), layers)


def test_the_joined_network_has_the_first_networks_actions_and_contains_the_second() -> None:
    rng = np.random.default_rng(0)
    first, second = network(rng, (9, 8, 4, 3)), network(rng, (5, 6, 7, 3))
    seen, observed = np.array([8, 1, 3, 0, 6]), rng.normal(size=(20, 9)).astype(np.float32)
    layers = side_by_side(first, second, seen, 0.5, jax.random.PRNGKey(0))
    assert [bias.size for _, bias in layers] == [18, 13, 3]
    normal = (observed - first.mean) / first.std
    np.testing.assert_allclose(mean_action(layers, normal), action_of(first, observed), atol=1e-3)
    kernel, bias = (np.zeros_like(each) for each in layers[-1])
    kernel[4:11], bias = second.layers[-1]
    found = mean_action((*layers[:-1], (kernel, bias)), normal)
    np.testing.assert_allclose(found, action_of(second, observed[:, seen]), atol=1e-3)
