"""Fixtures for the tests of `envs`."""

from collections.abc import Iterator
from importlib.util import find_spec

import pytest


@pytest.fixture(autouse=True, scope="package")
def compiled_quickly() -> Iterator[None]:
    """LLVM compiles the generated physics four times as fast without optimisation, to the same results."""
    with pytest.MonkeyPatch.context() as patch:
        if find_spec("llvmlite"):
            from footfall.envs.physics.generated import llvm

            patch.setattr(llvm, "OPTIMISATION", 0)
        yield
