"""brax's networks without its simulator."""

import subprocess
import sys

IMPORTED = """
import sys
{first}
import footfall.train.brax.trainer
print("mujoco.mjx" in sys.modules, "trimesh" in sys.modules)
import brax
print(brax.State.__module__, brax.System.__module__)
"""


def run(first: str) -> list[str]:
    command = [sys.executable, "-c", IMPORTED.format(first=first)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()


def test_training_imports_no_simulator_that_it_does_not_use() -> None:
    lean = run("")
    assert lean[0] == "False False"
    assert lean[-1] == "brax.base brax.base"  # available on access
