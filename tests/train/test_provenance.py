"""The source revision that a run records."""

import re
import subprocess
from pathlib import Path

import pytest

from footfall.train.runs import provenance


def test_a_revision_differs_for_each_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def git(*arguments: str) -> None:
        subprocess.run(
            ["git", "-c", "user.name=a", "-c", "user.email=b", *arguments], cwd=tmp_path, check=True
        )

    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "provenance.py"))
    git("init", "-q")
    source = tmp_path / "source.py"
    (tmp_path / "provenance.py").touch()
    seen = []
    for text in ("one", "two", "three", "one"):
        source.write_text(text)
        if not seen:
            git("add", "-A")
            git("commit", "-q", "-m", "source")
        seen.append(provenance.source_revision())
    clean, two, three, again = seen
    assert re.fullmatch("[0-9a-f]{40}", clean)
    assert two.startswith(f"{clean} with uncommitted changes ")
    assert len({clean, two, three}) == 3
    assert again == clean
    source.write_text("two")
    git("add", "-A")  # staged is not committed
    assert provenance.source_revision() == two


@pytest.mark.parametrize("in_a_repository", [False, True])
def test_installed_files_identify_the_code_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_a_repository: bool
) -> None:
    """An installed wheel has only its files; its environment may be inside another repository."""
    installed = tmp_path / ".venv" / "footfall"
    (installed / "train" / "runs").mkdir(parents=True)
    (installed / "policies").mkdir()
    source, data = installed / "train" / "api.py", installed / "policies" / "gaits.yaml"
    monkeypatch.setattr(provenance, "__file__", str(installed / "train" / "runs" / "provenance.py"))
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    if in_a_repository:
        (tmp_path / ".gitignore").write_text(".venv")
        for arguments in ("init -q", "add -A", "-c user.name=a -c user.email=b commit -q -m theirs"):
            subprocess.run(["git", *arguments.split()], cwd=tmp_path, check=True)
    seen = []
    for code, gaits in (("one", "trot"), ("two", "trot"), ("one", "pace"), ("one", "trot")):
        source.write_text(code)
        data.write_text(gaits)
        seen.append(provenance.source_revision())
    assert all(re.fullmatch("digest [0-9a-f]{8}", revision) for revision in seen)
    assert len(set(seen)) == 3
    assert seen[3] == seen[0]
