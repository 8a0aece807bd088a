"""An export is written only if ONNX Runtime agrees with the trainer's own network."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")

from footfall.common.errors import UserError
from footfall.policies.contract import Contract
from footfall.train.actor import Actor
from footfall.train.export import export

INPUTS, HIDDEN, ACTIONS = 110, 8, 12  # the first and the last as in the contract


def actor(shift: float = 0.0) -> Actor:
    """A small ELU network, and its declared outputs, which may be shifted."""
    rng = np.random.default_rng(0)
    mean = np.linspace(-1.0, 1.0, INPUTS, dtype=np.float32)
    deviation = np.full(INPUTS, 2.0, np.float32)
    sizes = ((INPUTS, HIDDEN), (HIDDEN, ACTIONS))
    layers = tuple(
        (rng.normal(0.0, 0.1, size).astype(np.float32), rng.normal(size=size[1]).astype(np.float32))
        for size in sizes
    )

    def act(observed: np.ndarray) -> np.ndarray:
        (first, first_bias), (last, last_bias) = layers
        x = (observed - mean) / deviation @ first + first_bias
        return np.where(x > 0, x, np.expm1(np.minimum(x, 0))) @ last + last_bias + shift

    return Actor("brax", mean, deviation, layers, act)


def test_an_export_that_agrees_is_written(contract: Contract, tmp_path: Path) -> None:
    worst = export(actor(), contract, np.zeros((0, INPUTS)), tmp_path / "policy.onnx")
    assert worst < 1e-5
    assert [path.name for path in tmp_path.iterdir()] == ["policy.onnx"]


@pytest.mark.parametrize("shift", [2e-5, -2e-5, np.nan, np.inf])
def test_an_export_that_differs_is_not_written(contract: Contract, tmp_path: Path, shift: float) -> None:
    """A policy whose difference is NaN is not written either."""
    with pytest.raises(UserError):
        export(actor(shift=shift), contract, np.zeros((0, INPUTS)), tmp_path / "policy.onnx")
    assert list(tmp_path.iterdir()) == []


def test_an_export_is_tested_on_observations_of_the_training(contract: Contract, tmp_path: Path) -> None:
    """A network that agrees around its mean may differ far from it."""
    far = np.full((1, INPUTS), 100.0)
    honest = actor()

    def differs_far_away(observed: np.ndarray) -> np.ndarray:
        return honest.act(observed) + (np.abs(observed) > 50.0).any(axis=1, keepdims=True)

    wrong = honest._replace(act=differs_far_away)
    with pytest.raises(UserError):
        export(wrong, contract, far, tmp_path / "policy.onnx")
