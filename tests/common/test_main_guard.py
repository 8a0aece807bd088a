"""Scripts that start processes need a main guard."""

import subprocess
import sys
from pathlib import Path

import pytest

CALL = """
from footfall.evaluate.pool import run_all
def score():
    run_all(abs, [-1], workers=1)
"""


@pytest.mark.parametrize("guarded", [False, True])
def test_a_script_without_a_main_guard_is_refused_with_advice(tmp_path: Path, guarded: bool) -> None:
    script = tmp_path / "mine.py"
    script.write_text(CALL + ("if __name__ == '__main__':\n    score()\n" if guarded else "score()\n"))
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == (0 if guarded else 1), done.stderr
    if not guarded:
        assert done.stderr.splitlines()[-1].endswith(
            "UserError: mine.py, line 5 starts processes that import mine.py:"
            ' put its main part under if __name__ == "__main__":'
        )
