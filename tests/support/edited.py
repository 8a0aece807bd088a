"""Changes a user's copy of a robot folder."""

from pathlib import Path


def edit(folder: Path, file: str, old: str, new: str) -> None:
    """Replace the first occurrence of a text in one of the folder's files; the text must be there."""
    text = (folder / file).read_text()
    assert old in text, old
    (folder / file).write_text(text.replace(old, new, 1))
