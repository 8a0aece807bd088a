"""rsl_rl is an extra: everything else goes without it, and its lack is one line."""

import subprocess
import sys
from pathlib import Path

import pytest
from import_apart import ROOT, import_apart

pytest.importorskip("jax")

# As if a package were not installed.
WITHOUT = """
import sys
sys.modules[sys.argv[1]] = None
from footfall.cli import main
sys.exit(main(sys.argv[2:]))
"""


def test_training_with_brax_needs_no_torch() -> None:
    import_apart(["footfall.train.api"], blocked=("torch", "rsl_rl", "tensordict"))


@pytest.mark.parametrize("missing", ["torch", "rsl_rl"])
def test_the_lack_of_the_extra_is_one_line(tmp_path: Path, missing: str) -> None:
    command = [sys.executable, "-c", WITHOUT, missing, "train", "--preset", "smoke", "--trainer", "rsl_rl"]
    done = subprocess.run(
        [*command, "--out", str(tmp_path / "run")], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert "[rsl-rl]'" in done.stderr
    assert not (tmp_path / "run").exists()
