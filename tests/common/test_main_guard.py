"""Scripts that start processes need a main guard."""

import subprocess
import sys
from pathlib import Path

CALL = """
from footfall.evaluate.pool import run_all
def score():
    run_all(abs, [-1], workers=1)
score()
"""


def test_a_script_without_a_main_guard_is_refused_with_advice(tmp_path: Path) -> None:
    script = tmp_path / "mine.py"
    script.write_text(CALL)
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 1, done.stderr
    assert done.stderr.splitlines()[-1].endswith(
        "UserError: mine.py, line 5 starts processes that import mine.py:"
        ' put its main part under if __name__ == "__main__":'
    )
