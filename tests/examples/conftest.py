"""A user's folder for the examples."""

from pathlib import Path

import pytest
from user_folder import UserFolder


@pytest.fixture
def user_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> UserFolder:
    """The working folder, outside the repository, with modules that share names with footfall's rooms."""
    monkeypatch.chdir(tmp_path)
    return UserFolder(tmp_path)
