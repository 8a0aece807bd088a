"""Atomic writes: the content is on the disk before its name."""

import os
from pathlib import Path

import pytest

from footfall.common.files import write_atomically


def test_the_content_is_on_the_disk_before_the_file_gets_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, happened = tmp_path / "kept", []
    path.write_bytes(b"old")
    plain_fsync, plain_replace = os.fsync, os.replace

    def fsync(handle: int) -> None:
        plain_fsync(handle)
        reached = Path(f"/proc/self/fd/{handle}").resolve()
        happened.append(("synced", b"" if reached.is_dir() else reached.read_bytes()))

    def replace(source: str, target: Path) -> None:
        assert path.read_bytes() == b"old"
        plain_replace(source, target)
        happened.append(("named", path.read_bytes()))

    monkeypatch.setattr(os, "fsync", fsync)
    monkeypatch.setattr(os, "replace", replace)
    write_atomically(path, b"new")
    assert happened == [("synced", b"new"), ("named", b"new"), ("synced", b"")]


@pytest.mark.parametrize("act", ["fsync", "replace"])
@pytest.mark.parametrize("error", [OSError("no space left"), KeyboardInterrupt()])
def test_a_write_that_fails_or_is_interrupted_leaves_the_old_content_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, act: str, error: BaseException
) -> None:
    def fail(*_: object) -> None:
        raise error

    path = tmp_path / "kept"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, act, fail)
    with pytest.raises(type(error)):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
