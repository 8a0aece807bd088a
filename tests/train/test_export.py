"""An export is written only if ONNX Runtime agrees with the network; `restamp` changes only the digest."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import helper

from footfall.common.errors import UserError
from footfall.policies.contract import CONTRACT_KEY, TRAINER_KEY, Contract
from footfall.policies.learned import open_network
from footfall.policies.registry import ZOO
from footfall.robots.description import Robot
from footfall.train.actor import Actor
from footfall.train.export import export
from footfall.train.restamp import restamp

INPUTS, HIDDEN, ACTIONS = 110, 8, 12  # the first and the last as in the contract
NO_OBSERVATIONS = np.zeros((0, INPUTS))


def actor(shift: float = 0.0) -> Actor:
    """A small ELU network, and its declared outputs, which may be shifted."""
    rng = np.random.default_rng(0)
    mean, deviation = np.linspace(-1.0, 1.0, INPUTS, dtype=np.float32), np.full(INPUTS, 2.0, np.float32)
    layers = tuple(
        (rng.normal(0.0, 0.1, size).astype(np.float32), rng.normal(size=size[1]).astype(np.float32))
        for size in ((INPUTS, HIDDEN), (HIDDEN, ACTIONS))
    )

    def act(observed: np.ndarray) -> np.ndarray:
        (first, first_bias), (last, last_bias) = layers
        x = (observed - mean) / deviation @ first + first_bias
        return np.where(x > 0, x, np.expm1(np.minimum(x, 0))) @ last + last_bias + shift

    return Actor("brax", mean, deviation, layers, act)


def test_an_export_is_written_only_if_it_agrees(contract: Contract, tmp_path: Path) -> None:
    """A difference may be NaN, or appear only in observations of the training, far from their mean."""

    def differs_far_away(observed: np.ndarray) -> np.ndarray:
        return actor().act(observed) + (np.abs(observed) > 50.0).any(axis=1, keepdims=True)

    far = actor()._replace(act=differs_far_away), np.full((1, INPUTS), 100.0)
    shifted = ((actor(shift), NO_OBSERVATIONS) for shift in (2e-5, -2e-5, np.nan, np.inf))
    for wrong, observations in (*shifted, far):
        with pytest.raises(UserError):
            export(wrong, contract, observations, tmp_path / "policy.onnx")
        assert list(tmp_path.iterdir()) == []
    assert export(actor(), contract, NO_OBSERVATIONS, tmp_path / "policy.onnx") < 1e-5
    assert [path.name for path in tmp_path.iterdir()] == ["policy.onnx"]


@pytest.fixture
def outdated(tmp_path: Path) -> Path:
    """A policy of the zoo with an outdated digest."""
    folder = Path(shutil.copytree(ZOO / "go1-flat", tmp_path / "aged"))
    change_contract(folder, digest="0123456789abcdef")
    (folder / "run.yaml").write_text("robot: go1\nrobot_digest: 0123456789abcdef\n")
    return folder


def change_contract(folder: Path, **changes: object) -> None:
    path = folder / "policy.onnx"
    model = onnx.load(path)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    contract = replace(Contract.from_json(metadata[CONTRACT_KEY], ""), **changes)
    helper.set_model_props(model, metadata | {CONTRACT_KEY: contract.to_json()})
    onnx.save(model, path)


def test_only_the_digest_changes(outdated: Path, go1: Robot) -> None:
    network, before = open_network(outdated / "policy.onnx")
    assert restamp(outdated) == ("0123456789abcdef", go1.digest)
    restamped, after = open_network(outdated / "policy.onnx")
    assert after == replace(before, digest=go1.digest)
    assert restamped.get_modelmeta().custom_metadata_map[TRAINER_KEY] == "brax"
    observed = np.random.default_rng(0).normal(size=(1, network.get_inputs()[0].shape[-1]))
    feed = {"observation": observed.astype(np.float32)}
    np.testing.assert_array_equal(restamped.run(None, feed)[0], network.run(None, feed)[0])
    assert (outdated / "run.yaml").read_text() == f"robot: go1\nrobot_digest: {go1.digest}\n"


def test_a_policy_with_other_differences_is_refused_and_left_unchanged(outdated: Path) -> None:
    change_contract(outdated, kp=(1.0,) * 12)
    content = (outdated / "policy.onnx").read_bytes()
    with pytest.raises(UserError, match="kp: "):
        restamp(outdated)
    assert (outdated / "policy.onnx").read_bytes() == content
