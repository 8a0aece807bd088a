"""An imported library prints nothing on stdout; the workaround for MJX goes when MJX agrees."""

import subprocess
import sys
from importlib.util import find_spec

import pytest
from long_tests import long_test

pytest.importorskip("mujoco.mjx")


def said_by(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout


@pytest.mark.parametrize(
    "code",
    [
        "from footfall.train.entry import learning_libraries\n"
        "with learning_libraries(): import footfall.train.api",
        "import gymnasium; gymnasium.make('footfall.gym:footfall/Go1Velocity-v0')",
    ],
)
def test_an_import_prints_nothing(code: str) -> None:
    assert said_by(code) == ""


@long_test
@pytest.mark.skipif(find_spec("warp") is not None, reason="Warp is installed: MJX finds it and says nothing")
def test_mjx_itself_still_prints() -> None:
    """When this fails, delete envs/workarounds/quiet_mjx.py."""
    assert "Failed to import warp" in said_by("import mujoco.mjx")
