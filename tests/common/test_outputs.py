"""Files that a command writes; the content is on the disk before its name."""

import json
import os
import stat
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from footfall.common.config import read_yaml
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.common.outputs import check_outputs, is_device, write_json, write_text


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
@pytest.mark.parametrize("error", [OSError(28, "no space left"), KeyboardInterrupt()])
def test_a_write_that_fails_or_is_interrupted_leaves_the_old_content_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, act: str, error: BaseException
) -> None:
    path = tmp_path / "kept"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, act, Mock(side_effect=error))
    with pytest.raises(type(error)):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]
    if isinstance(error, OSError):
        with pytest.raises(UserError, match="no space left"):
            write_text(path, "new")


def test_a_file_has_the_mode_that_it_is_given(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a", b"x", mode=0o604)
    mask = os.umask(0o027)
    try:
        write_atomically(tmp_path / "b", b"y")
    finally:
        assert os.umask(mask) == 0o027  # the mask stays unchanged
    assert [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in "ab"] == [0o604, 0o640]


def test_an_unwritable_path_is_named_and_an_older_file_is_kept(tmp_path: Path) -> None:
    """Checking leaves nothing behind."""
    check_outputs(tmp_path / "report.html", None)
    assert list(tmp_path.iterdir()) == []
    file = tmp_path / "file"
    file.write_text("old")
    for path, named in (
        (tmp_path / "new" / "report.html", str(tmp_path / "new")),
        (tmp_path, str(tmp_path)),
        (file / "report.json", r"report\.json"),
        (Path("/proc/run.json"), "/proc"),
    ):
        with pytest.raises(UserError, match=named):
            check_outputs(path)
    check_outputs(file)
    assert file.read_text() == "old"
    write_text(file, "new ✓")
    assert file.read_text(encoding="utf-8") == "new ✓"
    assert os.listdir(tmp_path) == ["file"]


def test_an_input_is_never_overwritten(tmp_path: Path) -> None:
    read, link = tmp_path / "walk.csv", tmp_path / "link"
    read.write_text("readings")
    link.symlink_to(read)
    for output in (read, link, tmp_path / "." / "walk.csv"):
        with pytest.raises(UserError):
            check_outputs(tmp_path / "other", output, inputs=["trot", None, read])
    check_outputs(tmp_path / "other", inputs=["a" * 300, read])


def test_a_name_that_is_too_long_is_refused_and_the_longest_is_written(tmp_path: Path) -> None:
    longest = tmp_path / ("a" * 255)
    check_outputs(longest)
    write_text(longest, "whole")
    assert longest.read_text() == "whole"
    with pytest.raises(UserError):
        check_outputs(tmp_path / ("a" * 256))


def test_a_named_pipe_is_refused_and_an_open_pipe_is_not(tmp_path: Path) -> None:
    """Opening a named pipe waits for the other end."""
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    for act in (check_outputs, read_yaml):
        with pytest.raises(UserError):
            act(fifo)
    reader, writer = os.pipe()
    with os.fdopen(reader), os.fdopen(writer):
        check_outputs(Path(f"/dev/fd/{writer}"))


def test_arrays_paths_and_numbers_become_plain_json(tmp_path: Path) -> None:
    content = {
        1: (1, 2.5),
        "array": np.array([[1.5, np.nan]]),
        "scalars": [np.float32(0.5), np.bool_(True), Path("a/b"), None],
        "nested": [{"x": float("-inf")}],
    }
    write_json(tmp_path / "a.json", content)
    text = (tmp_path / "a.json").read_text()
    assert json.loads(text) == {
        "1": [1, 2.5],
        "array": [[1.5, None]],
        "scalars": [0.5, True, "a/b", None],
        "nested": [{"x": None}],
    }
    assert text.endswith("}\n")
    write_json(None, content)


def test_a_device_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    paths = (pipe, Path("/dev/null"), tmp_path, tmp_path / "none")
    assert [is_device(path) for path in paths] == [True, True, False, False]
    check_outputs(Path("/dev/null"))
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_text(pipe, "through ✓")
        assert os.read(reader, 100).decode() == "through ✓"
    finally:
        os.close(reader)
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_the_target_of_a_link_is_replaced(tmp_path: Path) -> None:
    real, link = tmp_path / "there" / "real", tmp_path / "link"
    real.parent.mkdir()
    real.write_text("old")
    link.symlink_to(real)
    check_outputs(link)
    write_text(link, "new")
    assert (real.read_text(), link.is_symlink()) == ("new", True)
    with pytest.raises(UserError):
        check_outputs(link, tmp_path / "other", real)
    check_outputs(link, tmp_path / "other", None, None)


def test_the_refusal_of_two_equal_outputs_names_them(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="twice"):
        check_outputs(tmp_path / "once", tmp_path / "twice", tmp_path / "twice")
