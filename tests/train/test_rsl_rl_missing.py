"""rsl_rl is an extra: everything else works without it, and its absence is reported in one line."""

import sys
from pathlib import Path

import pytest
from import_in_process import import_in_process
from shell import Shell


def test_training_with_brax_needs_no_torch() -> None:
    import_in_process(["footfall.train.api"], blocked=("torch", "rsl_rl", "tensordict"))


@pytest.mark.parametrize("missing", ["torch", "rsl_rl"])
def test_a_missing_extra_is_reported_in_one_line(
    tmp_path: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    loaded = [name for name in sys.modules if name.startswith((f"{missing}.", "footfall.train.rsl_rl"))]
    for name in loaded:  # by other tests of this process
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, missing, None)
    command = ("train", "--preset", "smoke", "--trainer", "rsl_rl", "--out", tmp_path / "run")
    assert "[rsl-rl]'" in shell.refuses(*command)
    assert not (tmp_path / "run").exists()
