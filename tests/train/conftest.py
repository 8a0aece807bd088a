"""Fixtures for the tests of `train`."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("jax")

import jax
from jax.experimental.compilation_cache.compilation_cache import reset_cache

from footfall.train.config import load_preset
from footfall.train.runs.folder import Provenance, Run, create_run


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """A run of the preset smoke that has not started: 16 iterations of 256 steps."""
    provenance = Provenance("go1", 5, "smoke", "brax", "cpu", "abc", "2026-01-01", {"jax": "1"})
    return create_run(tmp_path / "run", provenance, load_preset("smoke"))


@pytest.fixture
def disk() -> Iterator[Path]:
    """A folder on a disk of one megabyte."""
    folder = Path("/tmp") / f"footfall-small-disk-{os.getpid()}"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", folder]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        folder.rmdir()
        pytest.skip("a small disk can be mounted by root only")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)
    folder.rmdir()


@pytest.fixture
def hangups_end_the_process() -> Iterator[None]:
    """SIGHUP acts as without nohup, under which the tests themselves may run."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture
def private_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A cache of its own; afterwards JAX's settings are restored."""
    kept = ("jax_compilation_cache_dir", "jax_persistent")
    before = {name: value for name, value in jax.config.values.items() if name.startswith(kept)}
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "jax"))
    reset_cache()
    (tmp_path / "jax").mkdir()
    yield tmp_path / "jax"
    for name, value in before.items():
        jax.config.update(name, value)
    reset_cache()


@pytest.fixture(scope="session")
def counting() -> Any:
    """The first state of a training in a `CountingEnvironment`."""
    from number_environment import COUNTING, COUNTING_NETWORKS, CountingEnvironment

    from footfall.train.brax.state import initial_state

    return jax.jit(lambda: initial_state(CountingEnvironment(), COUNTING_NETWORKS, COUNTING, 3))()


@pytest.fixture
def number_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rollouts step a `NumberEnvironment` as a whole."""
    import number_environment

    from footfall.train.brax import rollout

    monkeypatch.setattr(rollout, "step_batch", number_environment.step_batch)
