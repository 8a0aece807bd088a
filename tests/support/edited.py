"""Changes a user's copy of a robot folder."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml


def edit(folder: Path, file: str, old: str, new: str) -> None:
    """Replace the first occurrence of a text in one of the folder's files; the text must be there."""
    text = (folder / file).read_text()
    assert old in text, old
    (folder / file).write_text(text.replace(old, new, 1))


@contextmanager
def content_of(path: Path) -> Iterator[dict[str, Any]]:
    """The content of a YAML file, which is written back with its changes."""
    content = yaml.safe_load(path.read_text())
    yield content
    path.write_text(yaml.safe_dump(content))
