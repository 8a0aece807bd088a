"""An imported library prints nothing on stdout; the workaround for MJX is obsolete when MJX does so, too."""

import subprocess
import sys

import pytest

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
