"""`restamp` changes only the digest, and only of a policy that otherwise fits the robot."""

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
from footfall.train.restamp import restamp


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A policy of the zoo with an outdated digest."""
    folder = tmp_path / "aged"
    shutil.copytree(ZOO / "go1-flat", folder)
    write(folder, digest="0123456789abcdef")
    (folder / "run.yaml").write_text("robot: go1\nrobot_digest: 0123456789abcdef\n")
    return folder


def write(folder: Path, **changes: object) -> None:
    """Change fields of the contract."""
    path = folder / "policy.onnx"
    model = onnx.load(path)
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    contract = replace(Contract.from_json(metadata[CONTRACT_KEY], ""), **changes)
    helper.set_model_props(model, metadata | {CONTRACT_KEY: contract.to_json()})
    onnx.save(model, path)


def test_only_the_digest_changes(folder: Path, go1: Robot) -> None:
    network, before = open_network(folder / "policy.onnx")
    assert restamp(folder) == ("0123456789abcdef", go1.digest)
    restamped, after = open_network(folder / "policy.onnx")
    assert after == replace(before, digest=go1.digest)
    assert restamped.get_modelmeta().custom_metadata_map[TRAINER_KEY] == "brax"
    observed = np.random.default_rng(0).normal(size=(1, network.get_inputs()[0].shape[-1]))
    feed = {"observation": observed.astype(np.float32)}
    np.testing.assert_array_equal(restamped.run(None, feed)[0], network.run(None, feed)[0])
    assert (folder / "run.yaml").read_text() == f"robot: go1\nrobot_digest: {go1.digest}\n"


def test_a_policy_with_other_differences_is_refused_and_left_unchanged(folder: Path) -> None:
    write(folder, kp=(1.0,) * 12)
    content = (folder / "policy.onnx").read_bytes()
    with pytest.raises(UserError, match="kp: "):
        restamp(folder)
    assert (folder / "policy.onnx").read_bytes() == content
