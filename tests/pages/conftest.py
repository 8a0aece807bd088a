"""Fixtures for the tests of `pages`."""

import shutil
from importlib.util import find_spec
from pathlib import Path

import pytest

from footfall.policies.registry import ZOO
from footfall.train.config import load_preset
from footfall.train.runs.folder import Provenance, create_run


@pytest.fixture(autouse=True, scope="session")
def viser_installed() -> None:
    if find_spec("viser") is None:
        pytest.skip("needs viser: install footfall[watch]")


@pytest.fixture
def begun(tmp_path: Path) -> Path:
    """A run that has started and has nothing to show yet."""
    provenance = Provenance("go1", 0, "smoke", "brax", "cpu", "unknown", "2026-01-01", {})
    return create_run(tmp_path / "run", provenance, load_preset("smoke")).folder


@pytest.fixture
def finished(begun: Path) -> Path:
    """A run with a policy."""
    shutil.copy(ZOO / "go1-flat" / "policy.onnx", begun)
    return begun
