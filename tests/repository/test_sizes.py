"""Code files are small: no file outside the tests is longer than CONTRIBUTING permits."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
MOST_LINES = 300
SKIPPED = {"tests", "build", "dist", "shared", "runs"}


def test_no_file_of_code_is_long() -> None:
    folders = [folder for folder in ROOT.iterdir() if folder.is_dir() and folder.name not in SKIPPED]
    files = [path for folder in folders if folder.name[0] != "." for path in folder.rglob("*.py")]
    assert files
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    assert {str(path.relative_to(ROOT)): n for path, n in lines.items() if n > MOST_LINES} == {}
