"""Files that a command writes."""

import json
import os
import stat
from pathlib import Path

import numpy as np
import pytest

from footfall.common.config import read_yaml
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.common.outputs import check_outputs, is_device, write_json, write_text


def test_checking_leaves_nothing_behind(tmp_path: Path) -> None:
    check_outputs(tmp_path / "report.html", None)
    assert list(tmp_path.iterdir()) == []


def test_an_unwritable_path_is_named_and_an_older_file_is_kept(tmp_path: Path) -> None:
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
    with pytest.raises(UserError):
        check_outputs(fifo)
    with pytest.raises(UserError):
        read_yaml(fifo)
    reader, writer = os.pipe()
    with os.fdopen(reader), os.fdopen(writer):
        check_outputs(Path(f"/dev/fd/{writer}"))


def test_a_full_disk_is_refused_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(UserError, match="No space left"):
        write_text(tmp_path / "a.json", "new")


class TestOutputs:
    def test_arrays_paths_and_numbers_become_plain_json(self, tmp_path: Path) -> None:
        content = {
            1: (1, 2.5),
            "array": np.array([[1.5, np.nan]]),
            "number": np.float32(0.5),
            "flag": np.bool_(True),
            "path": Path("a/b"),
            "nested": [{"x": float("-inf")}],
            "none": None,
        }
        write_json(tmp_path / "a.json", content)
        text = (tmp_path / "a.json").read_text()
        assert json.loads(text) == {
            "1": [1, 2.5],
            "array": [[1.5, None]],
            "number": 0.5,
            "flag": True,
            "path": "a/b",
            "nested": [{"x": None}],
            "none": None,
        }
        assert text.endswith("}\n")
        write_json(None, content)

    def test_a_device_is_written_to_and_not_replaced(self, tmp_path: Path) -> None:
        pipe = tmp_path / "pipe"
        os.mkfifo(pipe)
        assert is_device(pipe)
        assert is_device(Path("/dev/null"))
        assert not is_device(tmp_path)
        assert not is_device(tmp_path / "none")
        check_outputs(Path("/dev/null"))
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        try:
            write_text(pipe, "through ✓")
            assert os.read(reader, 100).decode() == "through ✓"
        finally:
            os.close(reader)
        assert stat.S_ISFIFO(pipe.stat().st_mode)

    def test_the_target_of_a_link_is_replaced(self, tmp_path: Path) -> None:
        (tmp_path / "there").mkdir()
        real, link = tmp_path / "there" / "real", tmp_path / "link"
        real.write_text("old")
        link.symlink_to(real)
        check_outputs(link)
        write_text(link, "new")
        assert real.read_text() == "new"
        assert link.is_symlink()
        with pytest.raises(UserError):
            check_outputs(link, tmp_path / "other", real)
        check_outputs(link, tmp_path / "other", None, None)

    def test_a_file_has_the_mode_that_it_is_given(self, tmp_path: Path) -> None:
        write_atomically(tmp_path / "a", b"x", mode=0o604)
        assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o604
        mask = os.umask(0o027)
        try:
            write_atomically(tmp_path / "b", b"y")
            assert os.umask(0o027) == 0o027  # the mask stays unchanged
        finally:
            os.umask(mask)
        assert stat.S_IMODE((tmp_path / "b").stat().st_mode) == 0o640
