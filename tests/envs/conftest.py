"""What the tests of `envs` share."""

from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="package")
def compiled_quickly() -> Iterator[None]:
    """LLVM compiles the generated physics four times as fast without optimisation, to the same results."""
    pytest.importorskip("llvmlite")
    from footfall.envs.physics.generated import llvm

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(llvm, "OPTIMISATION", 0)
        yield
